"""Figures of what the paper left open, and of the rule (19)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from bayeshaptic.report.figures import style

from .hypotheses import Weighed
from .published import delay_s, relays
from .relays import RelayRun
from .residuals import LHIFAM, PHANTOM, USERS, Hypothesis, separation, values
from .rule_map import PERIOD_S, RuleMap, mode_hz

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def lhifam_held(weighed: Sequence[Weighed], first: int = 1, second: int = 5) -> Figure:
    """(a): K_CR before and after, and what two explanations predict for another measurement."""
    figure = style.new_figure(3.4)
    left, right = figure.subplots(1, 2, width_ratios=(1, 1.1))
    style.panel(left, x="critical stiffness, dB re 1 N/m")
    labels = [w.hypothesis.title.split(" (")[0].replace(" at ", "\nat ") for w in weighed]
    for row, one in enumerate(weighed):
        for draws, colour, up in (
            (one.prior_db, "#8c8c8c", 0.14),
            (one.posterior_db, style.MODEL, -0.14),
        ):
            low, middle, high = np.quantile(draws, [0.05, 0.5, 0.95])
            left.plot([low, high], [row + up] * 2, color=colour, linewidth=2)
            left.plot(middle, row + up, "o" if up > 0 else "s", color=colour, markersize=4)
    left.set_yticks(range(len(weighed)), labels)
    left.invert_yaxis()
    left.axvline(86.80, color=style.DATA, linewidth=0.8, linestyle="--")
    left.axvline(82.51, color=style.OTHER, linewidth=0.8, linestyle=":")
    for at, text in ((86.80, "predicted "), (82.51, "relay ")):
        left.text(at, -0.62, text, fontsize=style.SMALL, ha="center", va="bottom")
    left.set_xlim(77, 93)
    frequency = np.linspace(70.0, 140.0, 281)
    bands = separation(weighed[first], weighed[second], frequency)[:2]
    style.panel(right, "frequency, Hz", "gain of the held device, dB re 1 m/N")
    for band, number, colour, dash in zip(
        bands, (first, second), (style.MODEL, style.OTHER), ("-", "--"), strict=True
    ):
        right.fill_between(frequency, band[0], band[2], color=colour, alpha=0.22, linewidth=0)
        right.plot(frequency, band[1], dash, color=colour, linewidth=1.2, label=labels[number])
    nothing = Hypothesis("Table II", LHIFAM, 0.0).system(np.zeros((1, len(values(*LHIFAM)))))
    own = 20 * np.log10(np.abs(nothing.sampled_response(frequency, PERIOD_S)[0]))
    right.plot(frequency, own, ":", color=style.DATA, linewidth=1.0, label="Table II")
    style.legend(right, loc="upper right")
    return figure


def phantom_free(weighed: Sequence[Weighed], let_go: Sequence[RelayRun]) -> Figure:
    """(b): measured gains over frequency squared, candidates, and where a sampled relay settles."""
    figure = style.new_figure(3.3)
    left, right = figure.subplots(1, 2)
    gain, hertz = relays(*PHANTOM)
    frequency = np.linspace(12.0, 22.0, 60)
    style.panel(left, "frequency, Hz", "1/|G|, N m/rad")
    colours = (style.DATA, style.MODEL, style.OTHER, "#009e73")
    for number, colour, dash in zip((0, 3, 4, 5), colours, style.DASHES, strict=False):
        one = weighed[number]
        system = one.hypothesis.system(one.evidence.draws[:300])
        if number == 0:
            system = one.hypothesis.system(np.zeros((1, len(one.hypothesis.names))))
        stiffness = 1 / np.abs(system.sampled_response(frequency, PERIOD_S))
        low, middle, high = np.quantile(stiffness, [0.05, 0.5, 0.95], axis=0)
        left.fill_between(frequency, low, high, color=colour, alpha=0.15, linewidth=0)
        left.plot(
            frequency, middle, linestyle=dash, color=colour, linewidth=1.1,
            label=one.hypothesis.title.split(" (")[0] if number else "Table I",
        )  # fmt: skip
    left.errorbar(
        hertz,
        10 ** (gain / 20),
        xerr=0.25,
        fmt="o",
        color=style.DATA,
        markersize=4,
        label="measured (Table IV)",
    )
    style.legend(left, loc="upper left")
    style.panel(right, "frequency, Hz", "phase of the response + 180°, degrees")
    nothing = Hypothesis("Table I", PHANTOM, 0.0).system(np.zeros((1, len(values(*PHANTOM)))))
    phase = np.degrees(np.angle(-nothing.sampled_response(frequency, PERIOD_S)[0]))
    bound = 180 * frequency * PERIOD_S
    right.fill_between(
        frequency,
        -bound,
        bound,
        color="#e8e8e8",
        linewidth=0,
        label="where a sampled relay may settle",
    )
    right.plot(frequency, phase, color=style.DATA, linewidth=1.0, label="Table I")
    right.axhline(0, color="#8c8c8c", linewidth=0.6)
    right.plot(
        [run.measured.frequency_hz for run in let_go],
        [run.measured.phase_deg for run in let_go],
        "s",
        color=style.MODEL,
        markersize=4,
        label="relay on the bench, let go at four angles",
    )
    for hz in hertz:
        right.axvline(hz, color=style.OTHER, linewidth=0.8, linestyle=":")
    right.plot([], [], ":", color=style.OTHER, label="the paper's three trials")
    style.legend(right, loc="lower left")
    return figure


def phantom_users() -> Figure:
    """(c): the six users' gains over frequency, beside the response of Table I."""
    figure = style.new_figure(3.2, 5.2)
    axes = style.panel(figure.subplots(), "frequency, Hz", "gain margin, dB re 1 N m/rad")
    gain, hertz = relays(*USERS)
    frequency = np.linspace(49.0, 66.0, 200)
    table = Hypothesis("Table I", USERS, 0.0).system(np.zeros((1, len(values(*USERS)))))
    own = -20 * np.log10(np.abs(table.sampled_response(frequency, PERIOD_S)[0]))
    axes.plot(frequency, own, color=style.DATA, linewidth=1.0, label="1/|G| of Table I")
    shift = float(np.mean(gain - np.interp(hertz, frequency, own)))
    axes.plot(
        frequency,
        own + shift,
        "--",
        color=style.MODEL,
        linewidth=1.0,
        label=f"the same, {shift:+.1f} dB",
    )
    axes.errorbar(
        hertz,
        gain,
        xerr=0.25,
        fmt="o",
        color=style.DATA,
        markersize=4,
        label="six users (Table IV)",
    )
    style.legend(axes, loc="upper left")
    return figure


def rule(maps: Sequence[RuleMap], pretension: RuleMap) -> Figure:
    """Error of (19) over mode and delay for both devices, and over the LHIfAM's pretension."""
    figure = style.new_figure(3.1)
    panels = figure.subplots(1, 3, sharey=True)
    titles = ("PHANToM's masses", "LHIfAM's masses", "LHIfAM, cable's pretension")
    image = None
    for axes, one, title in zip(panels, (*maps, pretension), titles, strict=True):
        x = "cable stiffness, × published" if one is pretension else "vibration mode, Hz"
        style.panel(axes, x, title=title, grid=False)
        image = axes.pcolormesh(
            one.x,
            1e3 * one.y,
            one.error_db,
            cmap="RdBu_r",
            vmin=-8,
            vmax=8,
            shading="nearest",
            rasterized=True,
        )
        axes.contour(
            one.x,
            1e3 * one.y,
            np.abs(one.error_db),
            [0.5],
            colors="#1a1a1a",
            linewidths=0.8,
            linestyles="--",
        )
        axes.contour(
            one.x, 1e3 * one.y, one.on_mode.astype(float), [0.5], colors="#1a1a1a", linewidths=1.4
        )
        _log_ticks(axes, one is pretension)
    for axes, device, at in zip(
        panels,
        ("phantom", "lhifam", "lhifam"),
        (mode_hz("phantom"), mode_hz("lhifam"), 1.0),
        strict=True,
    ):
        axes.plot(
            at, 1e3 * delay_s(device), "*", color="#e69f00", markeredgecolor="black", markersize=10
        )
    panels[0].set_ylabel("loop delay, ms", fontsize=style.FONT)
    bar = figure.colorbar(image, ax=panels, shrink=0.9, extend="both")
    bar.set_label("rule (19) over K_CR, dB", fontsize=style.FONT)
    bar.ax.tick_params(labelsize=style.SMALL)
    return figure


def _log_ticks(axes: Axes, pretension: bool) -> None:
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullFormatter

    axes.set_xscale("log")
    places = (0.5, 1, 2) if pretension else (20, 50, 100, 200)
    axes.xaxis.set_major_locator(FixedLocator(places))
    axes.xaxis.set_major_formatter(FuncFormatter(style.plain))
    axes.xaxis.set_minor_formatter(NullFormatter())
