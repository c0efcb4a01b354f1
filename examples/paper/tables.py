"""The tables of docs/paper.md, and how they get into the page."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from .hypotheses import Weighed
from .identification import Identified, Row, tip_rows
from .margins import Margin, RigidMargin
from .published import TITLES, decibel
from .relays import RelayRun
from .residuals import HandSpread


def markdown(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [list(header), ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def put(page: Path, name: str, table: str) -> None:
    """Replace what stands between ``<!-- name -->`` and ``<!-- end -->``."""
    text = page.read_text(encoding="utf-8")
    pattern = re.compile(rf"(<!-- {re.escape(name)} -->\n).*?(\n<!-- end -->)", re.DOTALL)
    if not pattern.search(text):
        raise ValueError(f"{page} has no place for {name}")
    text = pattern.sub(lambda match: match[1] + table + match[2], text)
    page.write_text(text, encoding="utf-8")


def number(value: float, digits: int = 4) -> str:
    """Without powers of ten where a person would not use them."""
    text = f"{value:.{digits}g}"
    if "e" not in text:
        return text
    mantissa, exponent = text.split("e")
    power = int(exponent)
    return f"{value:.0f}" if 0 <= power < 6 else f"{mantissa}e{power}"


def identified(found: Identified) -> str:
    """Table I or II: published, least squares, posterior."""
    return markdown(
        ("parameter", "published", "least squares", "posterior, median and 99 % interval"),
        [_parameter(row) for row in found.rows],
    )


def at_tip(held: Identified) -> str:
    return markdown(
        ("at the tip", "published", "least squares", "posterior, median and 99 % interval"),
        [_parameter(row) for row in tip_rows(held)],
    )


def _parameter(row: Row) -> list[str]:
    low, _, middle, _, high = row.quantiles
    sd = "at its bound" if np.isnan(row.sd) else f"± {number(row.sd, 2)}"
    return [
        f"{row.name}, {row.unit}",
        number(row.published),
        f"{number(row.fitted)} {sd}",
        f"{number(middle)} ({number(low, 3)} to {number(high, 3)})",
    ]


def identified_limits(all_found: Sequence[Identified], margins: Sequence[Margin]) -> str:
    """K_CR of the posteriors beside that of the published parameters."""
    truth = {margin.case: margin.exact for margin in margins}
    rows = []
    for found in all_found:
        if found.case not in truth:
            continue
        low, middle, high = found.limit.db([0.05, 0.5, 0.95])
        crossings = "; ".join(
            f"{c.label}, {100 * c.probability:.0f} %" for c in found.limit.crossings
        )
        rows.append(
            [
                TITLES[found.case],
                f"{truth[found.case][0]:.2f} dB",
                f"{middle:.2f} ({low:.2f} to {high:.2f}) dB",
                crossings,
            ]
        )
    return markdown(
        ("", "truth on the bench", "posterior, median and 90 %", "binding crossing"), rows
    )


def table_3(margins: Sequence[Margin], rigid: RigidMargin) -> str:
    rows = [
        [
            TITLES[one.case],
            f"{one.published[0]:.2f} dB, {one.published[1]:.2f} Hz",
            f"{one.exact[0]:.2f} dB, {one.exact[1]:.2f} Hz",
            f"{one.continuous[0]:.2f} dB, {one.continuous[1]:.2f} Hz",
            f"{one.exact_box_db[0]:.2f} to {one.exact_box_db[1]:.2f} dB",
            f"{one.continuous_box_db[0]:.2f} to {one.continuous_box_db[1]:.2f} dB",
        ]
        for one in margins
    ]
    rows.append(
        [
            "PHANToM, rigid, at the tip",
            f"{rigid.published:.2f} N/m",
            f"{rigid.sampled:.2f} N/m",
            f"{rigid.rule:.2f} N/m by (19)",
            "",
            f"{rigid.rule_box[0]:.2f} to {rigid.rule_box[1]:.2f} N/m",
        ]
    )
    header = ("", "published", "exact hold", "continuous approximation")
    return markdown((*header, "rounding box, exact", "rounding box, continuous"), rows)


def table_4(runs: Sequence[RelayRun]) -> str:
    header = ("", "measured in the paper", "simulated relay", "model there", "followed to −180°")
    return markdown((*header, "K_CR of the model", "the relay settled on"), map(_relay, runs))


def _relay(run: RelayRun) -> list[str]:
    gain, hertz = run.published
    measured, check = run.measured, run.check
    followed = "not to be followed"
    if measured.critical_db is not None:
        error = f"{measured.critical_sd_db:.2f} dB, {measured.crossing_hz:.1f} Hz"
        followed = f"{measured.critical_db:.2f} ± {error}"
    place = check.settled_on
    if not check.binds:
        place += f" ({decibel(check.settled_stiffness):.2f} dB), not the one that binds"
    return [
        TITLES[run.case],
        f"{gain.min():.2f} to {gain.max():.2f} dB, {hertz.min():.2f} to {hertz.max():.2f} Hz",
        f"{measured.gain_margin_db:.2f} ± {measured.gain_margin_sd_db:.2f} dB, "
        f"{measured.frequency_hz:.2f} Hz, {measured.phase_deg:+.1f}°",
        f"{decibel(check.predicted):.2f} dB",
        followed,
        f"{decibel(check.critical_stiffness):.2f} dB, {check.binding_hz:.2f} Hz",
        place,
    ]


def hypotheses(columns: Sequence[tuple[str, Sequence[Weighed]]]) -> str:
    """ln evidence over that of the first hypothesis, a column a reading of the data."""
    rows = []
    for number_, one in enumerate(columns[0][1]):
        cells = [one.hypothesis.title]
        for _, weighed in columns:
            here, base = weighed[number_].evidence, weighed[0].evidence
            cells.append(f"{here.log_evidence - base.log_evidence:+.1f}" if number_ else "0")
        rows.append(cells)
    return markdown(("hypothesis", *(title for title, _ in columns)), rows)


def before_after(columns: Sequence[tuple[str, Sequence[Weighed]]]) -> str:
    """K_CR of each hypothesis before and after the relay data, and what had to give."""
    rows = []
    for number_, one in enumerate(columns[0][1]):
        cells = [one.hypothesis.title.split(" (")[0], _interval(one.prior_db)]
        for _, weighed in columns:
            cells.append(
                f"{_interval(weighed[number_].posterior_db)}; {what_gave(weighed[number_])}"
            )
        rows.append(cells)
    return markdown(
        ("hypothesis", "K_CR before, dB", *(f"after: {title}" for title, _ in columns)), rows
    )


def _interval(draws: np.ndarray) -> str:
    low, middle, high = np.quantile(draws, [0.05, 0.5, 0.95])
    return f"{middle:.1f} ({low:.1f} to {high:.1f})"


def what_gave(one: Weighed, most: int = 2) -> str:
    """The quantities that moved most, in their prior's standard deviations, with their values."""
    z = one.evidence.draws
    moved = np.abs(z.mean(axis=0))
    names, factors = one.hypothesis.names, one.factors()
    own = {unknown.name: unknown.median for unknown in one.hypothesis.extra}
    parts = []
    for index in np.argsort(-moved)[:most]:
        name = names[index]
        value = factors[name][1] / own.get(name, 1.0)
        parts.append(f"{name} × {value:.2f}")
    return ", ".join(parts)


def hands(rows: Sequence[tuple[str, HandSpread]]) -> str:
    def interval(read: object, pattern: str) -> str:
        low, middle, high = (format(read(p), pattern) for p in (0.05, 0.5, 0.95))  # type: ignore[operator]
        return f"{middle} ({low} to {high})"

    return markdown(
        (
            "reading",
            "log sd of the hand's parameters",
            "sd of K_CR it implies, dB",
            "common shift, dB",
        ),
        [
            [
                title,
                interval(one.quantile, ".2f"),
                interval(one.predicted_quantile, ".2f"),
                interval(one.shift_quantile, "+.1f") if len(one.shift_db) > 1 else "none allowed",
            ]
            for title, one in rows
        ],
    )
