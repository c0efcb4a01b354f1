"""How often feedback is missed, and how often a good open-loop recording is taken for it.

    python -m benchmarks.door [--each 360] [--part 0 --of 1] [--keep LINES] [--replay]
        [--trapezoids] [--bands]
    python -m benchmarks.door --show LINES...

Open loops and closed ones of random devices (`recordings/door.py`), judged as `check_recording`
judges them. In pieces: each part appends a line a recording to a file, and goes on where it
stopped; `--show` makes the tables of all. Of a closed loop, `weight` is what its answers to chance
amount to (`Case.weight`): where they are less than one sample's worth in all, nothing tells that
the force was computed, and nothing is biased either. `--replay` shows it: K_CR of each closed loop
that was missed, and of an open loop with the same force on the same device.
"""

from __future__ import annotations

import argparse
import json
import math
from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from bayeshaptic import analyse
from bayeshaptic.errors import InputError
from bayeshaptic.recordings.checks.sufficiency import refuse_where_told, too_little
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.signals.causality.causality import causality
from bayeshaptic.recordings.signals.controller import share_by_a_law
from bayeshaptic.rig import simulate
from benchmarks.recordings.controllers import TRAPEZOIDS
from benchmarks.recordings.door import Case, band_case, closed_case, open_case, written_down

WEIGHTS = (10.0, 100.0)
VERDICTS = ("feedback", "undecided", "open loop")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--each", type=int, default=360, help="recordings of each kind")
    parser.add_argument("--part", type=int, default=0, help="which part of them, from 0")
    parser.add_argument("--of", type=int, default=1, help="number of parts")
    parser.add_argument("--keep", type=Path, help="append a line a recording to this file")
    parser.add_argument("--replay", action="store_true", help="K_CR of what was missed")
    parser.add_argument("--trapezoids", action="store_true", help="closed loops that follow them")
    parser.add_argument("--show", type=Path, nargs="+", help="tables of such files, no new ones")
    parser.add_argument("--bands", action="store_true", help="noise of a band, taken for feedback?")
    options = parser.parse_args()
    if options.bands:
        bands(options.each)
        return
    if options.show:
        lines = [json.loads(line) for path in options.show for line in path.open()]
    else:
        lines = list(made(options))
    for name, table in tables(lines).items():
        print(f"\n{name}\n")
        show(table.items())
    replays(lines)


def bands(count: int) -> None:
    """How often the force's own far past says what looks like feedback, in open loop and closed."""
    for what, case in (("open loops under noise of a band", band_case), ("closed", closed_case)):
        found = [causality(case(seed).recording) for seed in range(count)]
        seen = [one for one in found if one.has_feedback]
        far, doubtful = sum(one.far_past for one in seen), sum(one.doubtful for one in found)
        print(
            f"{count} {what}: {len(seen)} called feedback, {far} of which the far past says as "
            f"well; {doubtful} undecided"
        )


def made(options: argparse.Namespace) -> Iterable[dict[str, Any]]:
    """A line for each recording of this part; those that are kept already, as they are."""
    kept = {}
    if options.keep and options.keep.exists():
        lines = map(json.loads, options.keep.open())
        kept = {(line["closed"], line["seed"]): line for line in lines}
    for make in (open_case, closed_case):
        for seed in range(options.part, options.each, options.of):
            if (done := kept.get((make is closed_case, seed))) is not None:
                yield done
                continue
            if make is open_case:
                case = open_case(seed)
            else:
                case = closed_case(seed, TRAPEZOIDS if options.trapezoids else None)
            line = {
                "closed": case.closed,
                "seed": seed,
                "verdict": judged(case),
                "traits": traits(case),
                "weight": case.weight,
            }
            if options.replay and case.closed and line["verdict"] == "open loop":
                line["replay"] = [limits(each, case) for each in (case.recording, replayed(case))]
            if options.keep:
                with options.keep.open("a") as file:
                    file.write(json.dumps(line) + "\n")
            yield line


def judged(case: Case) -> str:
    """The verdict on one recording."""
    found = causality(case.recording)
    if found.has_feedback or found.swapped or share_by_a_law(case.recording) > 0:
        return "feedback"
    return "undecided" if found.doubtful else "open loop"


def traits(case: Case) -> list[str]:
    """What a recording is counted under."""
    friction = "dry friction" if case.friction else "no dry friction"
    short = "under 5 s" if case.recording.duration_s < 5 else "over 5 s"
    kinds = [case.kind, case.reference, case.logged, case.device, friction, short]
    if case.closed:
        low, high = WEIGHTS
        w = case.weight
        kinds.append(
            f"weight under {low:g}"
            if w < low
            else f"weight {low:g} to {high:g}"
            if w < high
            else f"weight over {high:g}"
        )
    return [kind for kind in kinds if kind]


def replayed(case: Case) -> Recording:
    """The same force on the same device, in open loop, with other noise."""
    made = simulate(case.bench, case.recording.force, seed=1)
    return written_down(made.force, made.position, case.bench, case.logged)


def limits(recording: Recording, case: Case) -> list[float] | str:
    """K_CR's 90 % interval without the loop; or in short why there is none."""
    try:
        refuse_where_told(recording, too_little(recording))
        limit = analyse(recording, case.device.split()[1], ess=150.0).limit
    except InputError as error:
        return str(error)
    return [limit.quantile(0.05), limit.quantile(0.95)]


def tables(lines: Iterable[dict[str, Any]]) -> dict[str, dict[str, dict[str, int]]]:
    """Counts of verdicts, by trait."""
    found: dict[str, dict[str, dict[str, int]]]
    found = {
        name: defaultdict(lambda: dict.fromkeys(VERDICTS, 0))
        for name in ("open loop", "closed loop")
    }
    for line in lines:
        for key in ("all", *line["traits"]):
            found["closed loop" if line["closed"] else "open loop"][key][line["verdict"]] += 1
    return found


def show(rows: Iterable[tuple[str, dict[str, int]]]) -> None:
    """A table of counts."""
    print("| recordings | number | " + " | ".join(VERDICTS) + " |")
    print("| --- | --- |" + " --- |" * len(VERDICTS))
    for key, counts in rows:
        total = sum(counts.values())
        shares = (f"{counts[v]} ({100 * counts[v] / total:.1f} %)" for v in VERDICTS)
        print(f"| {key} | {total} | " + " | ".join(shares) + " |")


def replays(lines: Iterable[dict[str, Any]]) -> None:
    """What the missed ones cost: how far both intervals of K_CR lie apart."""
    pairs = [line for line in lines if "replay" in line]
    if not pairs:
        return
    refused = sum(isinstance(line["replay"][0], str) for line in pairs)
    apart, disjoint = [], 0
    for line in pairs:
        closed, opened = line["replay"]
        if isinstance(closed, str) or isinstance(opened, str):
            continue
        middles = [20 * math.log10(math.sqrt(low * high)) for low, high in (closed, opened)]
        apart.append(abs(middles[0] - middles[1]))
        disjoint += closed[0] > opened[1] or opened[0] > closed[1]
        print(f"seed {line['seed']}, weight {line['weight']:.2g}: {apart[-1]:.3f} dB apart")
    print(f"\n{len(pairs)} missed: {refused} say too little; of the other {len(apart)}, K_CR is")
    worst = sorted(apart)
    print(f"{worst[len(worst) // 2]:.3f} dB (median), at most {worst[-1]:.3f} dB from that of the")
    print(f"open loop with the same force; intervals are disjoint in {disjoint}")


if __name__ == "__main__":
    main()
