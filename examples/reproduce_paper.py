"""Reproduce Diaz and Gil (2010): python examples/reproduce_paper.py

Writes the figures to docs/images/paper/ and the tables into docs/paper.md, in a few minutes.
`--only margins,relays` does some of the parts.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING

from paper import (
    figures,
    identification,
    margins,
    open_figures,
    relays,
    residuals,
    rule_map,
    tables,
)
from paper.published import ROOT

from bayeshaptic.report.figures import style
from bayeshaptic.threads import one_thread_from_the_start

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PAGE = ROOT / "docs" / "paper.md"
IMAGES = ROOT / "docs" / "images" / "paper"

identified = cache(identification.identify_all)
relay_runs = cache(relays.relay_runs)
let_go = cache(relays.let_go)


def draw(name: str, figure: Figure) -> None:
    IMAGES.mkdir(parents=True, exist_ok=True)
    (IMAGES / f"{name}.png").write_bytes(style.png(figure))


def table(name: str, text: str) -> None:
    tables.put(PAGE, name, text)


def do_margins() -> None:
    """Table III."""
    table("table 3", tables.table_3(margins.table_3(), margins.rigid_margin()))


def do_identification() -> None:
    """Tables I and II, and Figures 5, 7, 9 and 10."""
    phantom_held, phantom_free, lhifam_held, lhifam_free, rigid = identified()
    for name, found in (
        ("phantom rigid", rigid),
        ("phantom free", phantom_free),
        ("phantom held", phantom_held),
        ("lhifam free", lhifam_free),
        ("lhifam held", lhifam_held),
    ):
        table(name, tables.identified(found))
    table("phantom tip", tables.at_tip(phantom_held))
    table("limits", tables.identified_limits(identified(), margins.table_3()))
    draw("figure-05-phantom-bode", figures.bode((phantom_free, phantom_held)))
    draw("figure-07-phantom-margins", figures.margins((rigid, phantom_free, phantom_held)))
    draw("figure-09-lhifam-bode", figures.bode((lhifam_free, lhifam_held)))
    draw("figure-10-lhifam-margins", figures.margins((lhifam_free, lhifam_held)))


def do_relays() -> None:
    """Table IV and Figure 12."""
    table("table 4", tables.table_4(relay_runs()))
    draw("figure-12-relay", figures.oscillation(relay_runs()[2]))


def do_lhifam() -> None:
    """Residual (a)."""
    columns = [
        (f"{title}, spread {100 * spread:.0f} %", residuals.lhifam_held(spread, sampled))
        for spread in (0.15, 0.05)
        for title, sampled in (("at the crossing", False), ("sampled relay", True))
    ]
    table("lhifam evidence", tables.hypotheses(columns))
    table("lhifam before after", tables.before_after(columns[:2]))
    draw("open-a-lhifam-held", open_figures.lhifam_held(columns[0][1]))


def do_phantom() -> None:
    """Residual (b)."""
    columns = [
        ("sampled relay, spread 5 %", residuals.phantom_free()),
        ("sampled relay, spread 15 %", residuals.phantom_free(spread=0.15)),
        ("at the crossing, spread 5 %", residuals.phantom_free(sampled=False)),
        ("sampled, 5 %, error 1 dB", residuals.phantom_free(gain_sd_db=1.0)),
    ]
    table("phantom evidence", tables.hypotheses(columns))
    table("phantom before after", tables.before_after(columns[:1]))
    draw("open-b-phantom-free", open_figures.phantom_free(columns[0][1], let_go()))


def do_users() -> None:
    """Residual (c)."""
    readings = [
        ("sampled relay, a common shift allowed", residuals.hand_spread()),
        ("sampled relay, no shift", residuals.hand_spread(shift_db=[0.0])),
        ("at the crossing, a common shift allowed", residuals.hand_spread(sampled=False)),
        (
            "sampled relay, shift, b1 and m2 vary as well",
            residuals.hand_spread(residuals.GRIP),
        ),
    ]
    table("hands", tables.hands(readings))
    draw("open-c-phantom-users", open_figures.phantom_users())


def do_rule() -> None:
    """Where (19) is good enough."""
    maps = [rule_map.over_mode_and_delay(device) for device in ("phantom", "lhifam")]
    draw("rule-map", open_figures.rule(maps, rule_map.over_pretension()))


PARTS: dict[str, Callable[[], None]] = {
    "margins": do_margins,
    "identification": do_identification,
    "relays": do_relays,
    "lhifam": do_lhifam,
    "phantom": do_phantom,
    "users": do_users,
    "rule": do_rule,
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--only", default=",".join(PARTS), metavar="PART,...", help=", ".join(PARTS)
    )
    for part in parser.parse_args().only.split(","):
        began = time.perf_counter()
        PARTS[part]()
        print(f"{part}: {time.perf_counter() - began:.1f} s")


if __name__ == "__main__":
    one_thread_from_the_start()
    main()
