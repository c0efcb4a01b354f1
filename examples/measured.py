"""Two measured recordings, and what closing the loop finds in them: figures of docs/measured.md.

    python -m examples.measured [FOLDER] [-o docs/images/measured]

FOLDER holds `two_mass_bench/MultisineTypeA.mat` and `emps/DATA_EMPS.mat`, which the project does
not contain; docs/measured.md says where they come from.
"""

from __future__ import annotations

import argparse
import os
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import bayeshaptic as bh
from bayeshaptic.diagnosis.feedback.inverse_dynamics import InverseDynamics, inverse_dynamics
from bayeshaptic.diagnosis.loop import trace
from bayeshaptic.diagnosis.periodic.harmonic_balance import Balanced, balance
from bayeshaptic.diagnosis.periodic.lines import FLOOR, BalancedState, LineTrials
from bayeshaptic.diagnosis.periodic.period import Period, one_period, with_floor
from bayeshaptic.diagnosis.state import REPORT, share
from bayeshaptic.diagnosis.traced import Traced
from bayeshaptic.effects.nonlinear.internal_force import LOAD
from bayeshaptic.effects.nonlinear.protocol import Motion
from bayeshaptic.recordings.response.etfe import compress
from bayeshaptic.recordings.response.spectra import PeriodicSpectra
from bayeshaptic.recordings.response.windows import Windows
from bayeshaptic.report.figures.style import CYCLE, DATA, MODEL, OTHER, new_figure, panel
from bayeshaptic.types import Floats

BENCH = "two_mass_bench/MultisineTypeA.mat"
SERVO = "emps/DATA_EMPS.mat"
BENCH_COLUMNS = "time=time*1e-6,force=iq_refx[A],position=theta_mx[rad]"
WITNESS_COLUMNS = "time=time*1e-6,force=iq_refx[A],position=theta_my*-1[rad]"
SERVO_COLUMNS = "time=t,force=vir*35.15[N],position=qm[m]"
_LOAD_HZ = 120.0  # above it the load's encoder shows little but noise
_FEWER = 10  # periods, to see what their number matters
_BANDS_HZ = (11, 40, 70, 100, 150, 251)


@dataclass(frozen=True)
class Bench:
    """The two-mass bench: the loop, and its models fitted to three quarters of the lines.

    Attributes
    ----------
    loop : Traced
    windows : Windows
        With the noise of a line at least `FLOOR` of its response; they weigh the fit.
    held_out : ndarray of bool
        Lines that took part neither in fitting nor in choosing.
    steps : tuple of Balanced
        From the base model on, none of them fitted to the held-out lines.
    load : Period
        The load's encoder, never fitted.
    """

    loop: Traced
    windows: Windows
    held_out: NDArray[np.bool_]
    steps: tuple[Balanced, ...]
    load: Period

    @property
    def names(self) -> list[str]:
        return ["base model", *(state.accepted[-1].title for state in self.loop.path[1:])]

    @property
    def noise(self) -> Floats:
        """Standard deviation of a line over its response, shape (L,)."""
        windows = self.windows
        variance = windows.scatter / (windows.lines - 2)
        return np.asarray(np.sqrt(variance) / np.abs(windows.target[:, 0]))

    def ratio(self, step: Balanced) -> NDArray[np.complex128]:
        """Model over measurement at every line."""
        measured = self.windows.target[:, 0]
        return np.asarray(1 - step.residual * self.noise * np.abs(measured) / measured)

    def phase_deg(self, step: Balanced, lines: NDArray[np.bool_]) -> float:
        """Rms error of the phase over lines."""
        return float(np.degrees(np.sqrt(np.mean(np.angle(self.ratio(step)[lines]) ** 2))))

    def load_error(self, step: Balanced) -> Floats:
        """Relative error of the predicted load at the excited lines below 120 Hz."""
        predicted = self.load.transform(step.motions[LOAD].position)
        measured = self.load.transform(self.load.position)
        hertz = self.load.s.imag / (2 * np.pi)
        excited = (self.load.harmonics >= self.load.excited[0]) & (hertz <= _LOAD_HZ)
        return np.asarray(np.abs(predicted / measured - 1)[excited])


def bench(path: Path) -> dict[str, Bench]:
    """Close the loop on the two-mass bench, and predict what was not fitted.

    Returns
    -------
    dict
        Where the noise of a line is taken from, to the models fitted with that noise. The first
        is the noise that chose them.
    """
    recording = bh.read_recording(path, columns=BENCH_COLUMNS)
    etfe = bh.estimate_etfe(recording)
    assert isinstance(etfe.spectra, PeriodicSpectra)
    witness = bh.read_recording(path, columns=WITNESS_COLUMNS)
    fit = bh.least_squares(bh.free(), etfe)
    loop = trace(etfe, fit)
    windows, period = compress(with_floor(etfe, FLOOR)), one_period(etfe)
    held_out, load = share(windows, REPORT), one_period(etfe, witness.position)
    stages = [state.whole for state in loop.path if isinstance(state, BalancedState)]
    # The recording ends with its last period.
    kept = recording.position[-etfe.spectra.periods * period.samples :].reshape(-1, period.samples)
    noises = {"beside the line": windows} | {
        f"between the last {count} periods": between_periods(windows, period, kept[-count:])
        for count in (len(kept), _FEWER)
    }
    found = {}
    for source, weighed in noises.items():
        steps = tuple(
            balance(s.model, weighed, period, s.forces, s.theta, s.strength, ~held_out)
            for s in stages
        )
        found[source] = Bench(loop, weighed, held_out, steps, load)
    return found


def close_again(path: Path, windows: Windows) -> Traced:
    """The loop on the two-mass bench with another noise from the start, that of `windows`."""
    etfe = bh.estimate_etfe(bh.read_recording(path, columns=BENCH_COLUMNS))
    assert isinstance(etfe.spectra, PeriodicSpectra)
    own = replace(etfe, spectra=replace(etfe.spectra, scatter=windows.scatter))
    fit = bh.least_squares(bh.free(), own)
    return trace(own, fit, trials=LineTrials(own, fit, floor=0.0))


def between_periods(windows: Windows, period: Period, kept: Floats) -> Windows:
    """The same lines; their noise is that of the mean of the periods, from the periods' scatter.

    Parameters
    ----------
    windows : Windows
    period : Period
    kept : ndarray, shape (M, N)
        Position, one period a row.

    Returns
    -------
    Windows
        With the noise of a line at least `FLOOR` of its response.
    """
    lines = np.fft.rfft(kept, axis=1)[:, period.excited]
    sd = np.sqrt(np.var(lines, axis=0, ddof=1) / len(kept))
    relative = np.maximum(sd / np.abs(lines.mean(axis=0)), FLOOR)
    variance = (relative * np.abs(windows.target[:, 0])) ** 2
    return replace(windows, scatter=(windows.lines - 2) * variance)


def servo(path: Path) -> tuple[InverseDynamics, InverseDynamics]:
    """Inverse dynamics of EMPS: the published four coefficients, and what more can be found."""
    recording = bh.read_recording(path, columns=SERVO_COLUMNS)
    return inverse_dynamics(recording, terms=("coulomb",)), inverse_dynamics(recording)


def draw_bench(found: Bench, folder: Path) -> None:
    """Three figures of the two-mass bench."""
    first, last = found.steps[0], found.steps[-1]
    hertz = found.windows.frequency_hz[:, 0]
    figure = new_figure(4.2)
    upper, lower = figure.subplots(2, 1, sharex=True)
    for step, colour, name in ((first, OTHER, "base model"), (last, MODEL, "with what was found")):
        size = 100 * np.abs(1 - found.ratio(step))
        upper.semilogy(hertz, size, color=colour, lw=0.7)
        upper.semilogy(
            hertz[found.held_out], size[found.held_out], "o", ms=3, color=colour, label=name
        )
        lower.plot(hertz, np.degrees(np.angle(found.ratio(step))), color=colour, lw=0.8)
    upper.semilogy(hertz, 100 * found.noise, color=DATA, lw=0.6, ls=":", label="noise")
    panel(upper, "", "error, % of response", title="Two-mass bench; dots: lines not fitted")
    upper.legend(fontsize=7, frameon=False)
    panel(lower, "frequency, Hz", "phase error, degrees")
    lower.set_ylim(-20, 20)
    figure.savefig(folder / "bench-lines.png")

    figure = new_figure(4.6)
    upper, lower = figure.subplots(2, 1)
    seconds = np.arange(found.load.samples) * found.load.period_s
    measured = found.load.position - found.load.position.mean()
    upper.plot(seconds, 1e3 * measured, color=DATA, lw=0.6, label="load encoder")
    for step, colour, name in ((first, OTHER, "base model"), (last, MODEL, "with what was found")):
        error = measured - step.motions[LOAD].position
        upper.plot(seconds, 1e4 * error - 280, color=colour, lw=0.7, label=f"10 x error, {name}")
    panel(upper, "time in the period, s", "load angle, mrad", title="Predicted, never fitted")
    upper.legend(fontsize=7, frameon=False, ncols=3)
    excited = found.load.excited[
        found.load.excited <= _LOAD_HZ * found.load.samples * found.load.period_s
    ]
    for step, colour in ((first, OTHER), (last, MODEL)):
        lower.semilogy(excited, 100 * found.load_error(step), color=colour, lw=0.9)
    panel(lower, "frequency, Hz", "load error, % of response")
    figure.savefig(folder / "bench-load.png")

    figure = new_figure(2.8)
    axes = figure.subplots()
    velocity = np.linspace(-35, 35, 300)
    speed = last.motions[LOAD].velocity
    for basis, strength in zip(last.forces, last.strength, strict=True):
        if basis.place == LOAD and basis.name == "drag":
            force = strength * basis.force(Motion(0 * velocity, velocity, 0 * velocity))
            axes.plot(velocity, force, color=MODEL, label=basis.title)
    damper = dict(zip(last.model.names, last.theta, strict=True))["b2"]
    axes.plot(velocity, -damper * velocity, color=DATA, ls="--", label="damper b2")
    axes.plot(speed[::4], np.full(len(speed[::4]), -0.0), "|", color=CYCLE[6], ms=6)
    panel(axes, "load velocity, rad/s (ticks: where it goes)", "force, A", title="What was found")
    axes.legend(fontsize=7, frameon=False)
    figure.savefig(folder / "bench-drag.png")


def draw_servo(published: InverseDynamics, further: InverseDynamics, folder: Path) -> None:
    """Residual force over velocity, and the error on the half that was not fitted."""
    figure = new_figure(3.0)
    left, right = figure.subplots(1, 2)
    values = [published[name][0] for name in ("mass", "damping", "offset")]
    path = published.path
    inertia = values[0] * path.acceleration + values[1] * path.velocity + values[2]
    for residual, colour, name in (
        (published.force - inertia, OTHER, "without friction"),
        (published.force - published.explained, CYCLE[1], "with Coulomb friction"),
        (further.force - further.explained, MODEL, "with all terms"),
    ):
        left.plot(path.velocity, residual, ".", ms=1.5, color=colour, label=name)
    panel(left, "velocity, m/s", "force not explained, N", title="EMPS: residual force")
    left.legend(fontsize=7, frameon=False, markerscale=4)
    names = [step.term for step in further.steps]
    right.barh(names, [step.held_out_rms for step in further.steps], color=MODEL)
    right.invert_yaxis()
    panel(right, "error on the other half, N rms", "", title="Terms as they were added")
    figure.savefig(folder / "servo.png")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    default = os.environ.get(
        "BAYESHAPTIC_MEASURED", str(Path(__file__).parents[2] / "shared" / "measured")
    )
    parser.add_argument("folder", nargs="?", type=Path, default=Path(default))
    parser.add_argument("-o", "--output", type=Path, default=Path("docs/images/measured"))
    given = parser.parse_args()
    given.output.mkdir(parents=True, exist_ok=True)
    published, further = servo(given.folder / SERVO)
    draw_servo(published, further, given.output)
    for fitted in (published, further):
        for term in fitted.terms:
            print(f"{term.title}: %.4g +- %.2g {term.unit}" % fitted[term.name])
        print(f"relative error {100 * fitted.relative_error:.2f} %, {fitted.rms:.2f} N rms")
    for added in further.steps:
        print(f"{added.term}: {added.held_out_rms:.2f} N on the half not fitted")
    benches = bench(given.folder / BENCH)
    for source, found in benches.items():
        print(f"noise {source}, median {100 * np.median(found.noise):.2f} % of the response")
        print_steps(found)
    result, between, _ = benches.values()
    out = result.held_out
    for name, step in zip(result.names, result.steps, strict=True):
        left = np.abs(1 - result.ratio(step)[out]) / between.noise[out]
        print(f"{name}, as fitted first: {np.sqrt(np.mean(left**2)):.2f} of the second noise")
    again = close_again(given.folder / BENCH, between.windows)
    print("accepted with the second noise:", *(effect.title for effect in again.state.accepted))
    last = [c for c in again.candidates if c.round == again.candidates[-1].round]
    for candidate in last[:3]:
        print(f"{candidate.title}, in the last round: score {candidate.score:.1f}")
    draw_bench(result, given.output)
    final = result.steps[-1]
    for basis, value, sd in zip(final.forces, final.strength, final.strength_sd, strict=True):
        print(f"{basis.title}: {value:.4g} +- {sd * final.rms():.2g} {basis.unit}")
    print(dict(zip(final.model.names, np.round(final.theta, 7), strict=True)))


def print_steps(found: Bench) -> None:
    """Error of every step on the lines and on the load's encoder."""
    out, every = found.held_out, np.full(len(found.held_out), True)
    for name, step in zip(found.names, found.steps, strict=True):
        load = found.load_error(step)
        print(
            f"{name}: weighted rms {step.rms(~out):.2f} fitted, {step.rms(out):.2f} held out; "
            f"phase {found.phase_deg(step, out):.2f} degrees held out, "
            f"{found.phase_deg(step, every):.2f} all; load off by "
            f"{100 * np.median(load):.2f} % (median), {100 * np.sqrt(np.mean(load**2)):.2f} % (rms)"
        )
    hertz = found.windows.frequency_hz[:, 0]
    size = 100 * np.abs(1 - found.ratio(found.steps[-1]))
    for low, high in pairwise(_BANDS_HZ):
        inside = out & (hertz >= low) & (hertz < high)
        print(f"{low} to {high} Hz: {np.median(size[inside]):.1f} % off, held out (median)")


if __name__ == "__main__":
    main()
