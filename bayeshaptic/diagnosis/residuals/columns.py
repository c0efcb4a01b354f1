"""Is there a force that is not linear in the motion?  Columns built from the motion tell.

Each candidate column is a nonlinear function of the command or of the motion, sent through the
mechanism.  In every window it is compared with what no smooth linear response explains, so that an
error of the linear model cannot raise it (nonlinear identification through feedback of the
outputs; S. F. Masri and T. K. Caughey, J. Appl. Mech. 46, 1979, for the force surface).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.special import ndtri, stdtr

from bayeshaptic.diagnosis import thresholds
from bayeshaptic.diagnosis.residuals.lines import Lines
from bayeshaptic.diagnosis.residuals.moved import coasting, slow_velocity
from bayeshaptic.diagnosis.residuals.residual import ForceSeen, Test
from bayeshaptic.diagnosis.residuals.unforced import commanded_motions, commanded_position
from bayeshaptic.effects.laws import tested
from bayeshaptic.effects.nonlinear.shapes import (
    ALONG,
    COMMAND,
    LOAD_VELOCITY,
    POSITION,
    STRETCH,
    STRETCH_VELOCITY,
    VELOCITY,
)
from bayeshaptic.inference.fit import Fit
from bayeshaptic.models.response.filters import share
from bayeshaptic.numerics.polynomials.polynomial import Polynomial, evaluate
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.recordings.response.windows import Windows, remembered
from bayeshaptic.types import Complexes, Floats

# Share of a column that is left beside the response where it is the response itself: a power of a
# force of two levels is that force, with the nine digits of a file.
ROUNDING = 1e-6
# Share of an instrument that its input has at least: less says nothing of how strong a force is.
# It bounds a strength's standard deviation, and no score, so it raises no alarm.
WEAK = 0.05


def nonlinear_tests(fit: Fit, etfe: Etfe) -> tuple[Test, ...]:
    """One test for each nonlinear function of command and motion; none without a recording.

    Of one piece; see `bayeshaptic.diagnosis.residuals.pieces`.
    """
    recording = etfe.unbroken
    if recording is None or etfe.period_lines is not None:
        return ()
    tests = []
    response = remembered(fit.response)
    made = columns(fit, recording, Lines.of(etfe, recording), etfe.through_reference)
    for name, inputs, rms in made:
        windows = etfe.spectra.windows(response, inputs)
        strength, sd, freedom = common_coefficient(windows, len(inputs))
        score = as_normal(abs(strength / sd), freedom) if sd > 0 else 0.0
        tests.append(force_test(name, score, ForceSeen(strength, sd, rms)))
    return tuple(tests)


def force_test(name: str, score: float, seen: ForceSeen) -> Test:
    """The test for a force of a shape by its score."""
    shape, what = tested().get(name), f"a force like {name}"
    # A formula of the motor's motion says itself what it is; of what is elsewhere the title does.
    if shape is not None and not shape.title.startswith(("a force like", "a command")):
        what = f"a force like {shape.title}"
    text = f"{what} stands {score:.1f} standard deviations out of the noise"
    return Test(name, "nonlinear", score, thresholds.two_sided(), None, text, seen)


def common_coefficient(windows: Windows, inputs: int = 1) -> tuple[float, float, float]:
    """Coefficient of the last input, the same in all windows, and its robust standard deviation.

    Each window's own smooth response is free, so only what it cannot explain counts.  Of two inputs
    the first is the instrument of the last.  Third come the degrees of freedom of the deviation:
    each window knows its own noise from its lines, and what a motion that is slow can tell stands
    in one or two of them (F. E. Satterthwaite, Biometrics Bulletin 2, 1946).
    """
    nodes = windows.frequency_hz.shape[1]
    instrument, found = windows.design[:, -inputs, -inputs], windows.target[:, -inputs]
    slope = windows.design[:, -inputs, -1]
    whole = np.linalg.norm(windows.design[:, :, -inputs], axis=1)
    instrument = np.where(np.abs(instrument) > ROUNDING * whole, instrument, 0.0)
    lines = np.maximum(windows.lines - nodes - 2, 0.5)
    others = np.sum(np.abs(windows.target[:, nodes + 1 :]) ** 2, axis=1)
    weight = lines / (windows.scatter + others)
    each = weight * np.abs(instrument) ** 2
    if not each.any():
        return 0.0, 0.0, 1.0
    answers = float(np.sum(weight * (instrument.conj() * slope).real))
    information = max(answers, WEAK * float(np.sum(each)))
    along = float(np.sum(weight * (instrument.conj() * found).real))
    left = found - along / np.sum(each) * instrument
    spread = np.sqrt(np.sum((weight * (instrument.conj() * left).real) ** 2))
    usual = np.sqrt(0.5 * np.sum(each))
    freedom = np.sum(each) ** 2 / float(np.sum(each**2 / (2 * lines)))
    return along / information, max(float(spread), float(usual)) / information, float(freedom)


def as_normal(score: float, freedom: float) -> float:
    """The normal score that is as unlikely as a score of Student's t."""
    chance = float(stdtr(freedom, -score))
    return float(-ndtri(chance)) if chance > 1e-300 else score


def columns(
    fit: Fit, recording: Recording, at_lines: Lines, in_loop: bool = False
) -> Iterator[tuple[str, Complexes, float]]:
    """Motions that nonlinear forces would add, one after the other: those of an hour are large.

    Where a hand moves the device, too, its own motion is in such a force and in what no response
    explains: what the command alone would make of the force comes first, as an instrument.

    Parameters
    ----------
    fit : Fit
    recording : Recording
    at_lines : Lines
    in_loop : bool
        Damping along the way is left out: of it, alone, eight clean loops have scores two and
        three times too large.

    Yields
    ------
    name : str
        Of the force's shape.
    motions : complex ndarray, shape (1 or 2, L)
        At the lines.
    rms : float
        Of the motion that the force is a function of, or is multiplied by.
    """
    known = motions(fit, recording)
    fast = float(known[VELOCITY].std())
    for over, motion in known.items():
        if in_loop and over == ALONG:
            continue
        response = response_to(fit, over, at_lines.s)
        driven = _by_the_command(fit, recording, over)
        times = known[VELOCITY] / fast if over == ALONG else 1.0
        for shape in tested().values():
            if shape.over == over:
                rms = float(motion.std())
                made = [motion] if driven is None else [driven, motion]
                added = [response * at_lines(times * shape.force(moved / rms)) for moved in made]
                yield shape.name, np.stack(added), fast if over == ALONG else rms


def _by_the_command(fit: Fit, recording: Recording, over: str) -> Floats | None:
    """A velocity that the command alone makes, where a hand makes some of it; None elsewhere."""
    by_hand = fit.model.held and recording.reference is None
    if not by_hand or over not in (VELOCITY, LOAD_VELOCITY):
        return None
    mass = 1 if over == LOAD_VELOCITY else 0
    return np.asarray(commanded_motions(fit, recording, (mass,))[0, 1])


def motions(fit: Fit, recording: Recording) -> dict[str, Floats]:
    """What a force may be a function of, shape (N,) each: by name.

    The motion is that of the model: signs taken from an encoder are those of its noise.
    """
    velocity = driven_velocity(fit, recording)
    position = recording.position - recording.position.mean()
    found = {VELOCITY: velocity, POSITION: position, ALONG: position}
    if len(fit.model.system(fit.theta).mechanism.masses) > 1:
        motor, load = commanded_motions(fit, recording, (0, 1))
        found[STRETCH], found[STRETCH_VELOCITY] = motor - load
        found[LOAD_VELOCITY] = load[1] + velocity - motor[1]  # what is slow moves both
    found[COMMAND] = recording.force - recording.force.mean()
    return found


def response_to(fit: Fit, over: str, s: Complexes) -> Complexes:
    """Position that is read over a force that is a function of `over`, at points s of shape (L,).

    What filters the position filters what forces do, and an actuator's lag does not.
    """
    if over in (STRETCH, STRETCH_VELOCITY):
        return pair_response(fit, s)
    if over == COMMAND:
        return np.asarray(fit.response(s.imag / (2 * np.pi)))
    if over == LOAD_VELOCITY:
        return load_response(fit, s)
    return fit.model.system(fit.theta).of_forces.continuous_response(s)[0]


def driven_velocity(fit: Fit, recording: Recording) -> Floats:
    """Velocity of the motor without encoder noise, shape (N,).

    What the command does comes from the model; what a hand does besides is taken from the
    measured position below 20 Hz, where the encoder sees it well, and of a free device how it began
    and what a constant force does: friction has a sign where it slides along with that.  In closed
    loop the command answers to whatever moves the device besides, as to a hand.
    """
    x, v = commanded_position(fit, recording), commanded_motions(fit, recording)[0, 1]
    if fit.model.held or recording.reference is not None:
        rest = recording.position - recording.position.mean() - x
        return np.asarray(v + slow_velocity(rest, recording.period_s))
    system = fit.model.system(fit.theta)
    return np.asarray(v + coasting(system, recording.position - x, recording.period_s)[1])


def load_response(fit: Fit, s: Complexes) -> Complexes:
    """Position that is read over a force at the load, at points s of shape (L,)."""
    system = fit.model.system(fit.theta)
    return _ratio(*system.mechanism.transfer_to(1), s) * share(system.sensing, s)


def pair_response(fit: Fit, s: Complexes) -> Complexes:
    """The same over a pair of forces in the connection, +1 on m1 and -1 on m2."""
    system = fit.model.system(fit.theta)
    mechanism = system.mechanism
    own = _ratio(mechanism.mutual(mechanism.drive, (0, 1)), mechanism.transfer()[1], s)
    return own * share(system.sensing, s)


def _ratio(numerator: Polynomial, denominator: Polynomial, s: Complexes) -> Complexes:
    points = s[:, None]
    return np.asarray((evaluate(numerator, points) / evaluate(denominator, points))[:, 0])
