"""How often feedback is missed, and how often a good open-loop recording is taken for it.

    python door.py [--each 360] [--first 0]

Open loops and closed ones of random devices (`door_recordings.py`), judged as `check_recording`
judges them. Of a closed loop, `answer` is the share of the force's power that answers to friction,
the hand and the counts of the encoder: without any, nothing tells that the force was computed, and
the response is not biased either.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from collections.abc import Iterable

from door_recordings import Case, closed_case, open_case

from bayeshaptic.recordings.signals.causality import causality

FAINT = 0.01  # of the force's power
VERDICTS = ("feedback", "undecided", "open loop")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--each", type=int, default=360, help="recordings of each kind")
    parser.add_argument("--first", type=int, default=0, help="seed of the first")
    options = parser.parse_args()
    seeds = range(options.first, options.first + options.each)
    tables: dict[str, dict[str, dict[str, int]]] = {
        name: defaultdict(lambda: dict.fromkeys(VERDICTS, 0))
        for name in ("open loop", "closed loop", f"closed loop, answer under {FAINT:.0%}")
    }
    for make, seed in ((m, s) for m in (open_case, closed_case) for s in seeds):
        case = make(seed)
        verdict = judged(case)
        faint = case.closed and case.answer < FAINT
        name = "closed loop" if case.closed else "open loop"
        table = tables[f"{name}, answer under {FAINT:.0%}" if faint else name]
        for key in ("all", *traits(case)):
            table[key][verdict] += 1
        if (verdict == "feedback") != case.closed and not faint:
            print(f"{name}, seed {seed}: {verdict} ({', '.join(traits(case))}, {case.answer:.2g})")
    for name, table in tables.items():
        print(f"\n{name}\n")
        show(table.items())


def judged(case: Case) -> str:
    """The verdict on one recording."""
    found = causality(case.recording)
    if found.has_feedback or found.swapped:
        return "feedback"
    return "undecided" if found.doubtful else "open loop"


def traits(case: Case) -> tuple[str, ...]:
    """What a recording is counted under."""
    friction = "dry friction" if case.friction else "no dry friction"
    short = "under 5 s" if case.recording.duration_s < 5 else "over 5 s"
    kinds = (case.kind, case.reference, case.logged, case.device, friction, short)
    return tuple(kind for kind in kinds if kind)


def show(rows: Iterable[tuple[str, dict[str, int]]]) -> None:
    """A table of counts."""
    print("| recordings | number | " + " | ".join(VERDICTS) + " |")
    print("| --- | --- |" + " --- |" * len(VERDICTS))
    for key, counts in rows:
        total = sum(counts.values())
        shares = (f"{counts[v]} ({100 * counts[v] / total:.1f} %)" for v in VERDICTS)
        print(f"| {key} | {total} | " + " | ".join(shares) + " |")


if __name__ == "__main__":
    main()
