"""Do the pieces of a recording have one response, as those of one device have?

Pieces count together because nothing says that they differ.  One of another device, in other units
or with its sign turned round is fitted like the others, and what it leaves looks like something
that the model lacks, or like a position that hardly answers.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from bayeshaptic.errors import Notice
from bayeshaptic.quantities import pure
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.types import Complexes, Floats

UNLIKE = "unlike"  # what a warning of the topic "pieces" is about, before the names
# Median over the frequencies: how many times noise the power of the difference is, in standard
# errors of such a median, and how far from one the ratio is at least.
_CLEAR, _LEAST = 6.0, 0.05
_FEWEST = 6  # frequencies
_NEAR = 0.03  # of a ratio that units make
_OF_UNITS = {
    180 / np.pi: "as one in degrees is of one in radians",
    1000.0: "as one in mm is of one in m",
}
_TURNED = 0.75 * np.pi


class _Difference(NamedTuple):
    """Of a piece from the mean of others: `clear` in standard errors, and the median `ratio`."""

    clear: float
    ratio: complex

    @property
    def found(self) -> bool:
        return self.clear > _CLEAR and abs(self.ratio - 1) > _LEAST


def unlike_pieces(etfe: Etfe) -> tuple[Notice, ...]:
    """The warning that some pieces do not have the response of the others; or none.

    No model is asked: the responses are compared where both were measured.  The piece that differs
    most from the mean of the others is set aside, until none does.

    Parameters
    ----------
    etfe : Etfe
        Of a recording in open loop; with feedback each response would be the controller's, too.
    """
    alike = list(etfe.parts)
    aside: list[tuple[Etfe, _Difference]] = []
    while len(alike) > 1:
        found = [_difference(one, [o for o in alike if o is not one]) for one in alike]
        far = [number for number, own in enumerate(found) if own.found]
        if not far:
            break
        worst = max(far, key=lambda number: found[number].clear)
        aside.append((alike.pop(worst), found[worst]))
    if not aside:
        return ()
    text = _told(aside, alike)
    return (Notice("warning", "pieces", text, (UNLIKE, *(_name(one) for one, _ in aside))),)


def named_unlike(notices: Iterable[Notice]) -> tuple[str, ...]:
    """The pieces of which a warning says that their response is another; empty without one.

    Parameters
    ----------
    notices : iterable of Notice
    """
    for notice in notices:
        if notice.topic == "pieces" and notice.about[:1] == (UNLIKE,):
            return notice.about[1:]
    return ()


def still_unlike(notices: Iterable[Notice], etfe: Etfe) -> tuple[Notice, ...]:
    """Notices of which those of unlike pieces are of what is left without the forces that act.

    Dry friction beside a larger force is a smaller damper: pieces of several levels have several
    responses, and one without the friction.

    Parameters
    ----------
    notices : iterable of Notice
    etfe : Etfe
        Without what forces add to the motion.
    """
    told = tuple(notices)
    if not named_unlike(told) or not etfe.parts:
        return told
    others = tuple(n for n in told if n.about[:1] != (UNLIKE,))
    return others + unlike_pieces(etfe)


def _difference(one: Etfe, others: Sequence[Etfe]) -> _Difference:
    frequency = np.asarray(one.frequency_hz)
    weighted, known = np.zeros(len(frequency), complex), np.zeros(len(frequency))
    for other in others:
        value, variance = _at(frequency, other)
        weight = 1 / variance
        weighted += weight * value
        known += weight
    both = known > 0
    if np.count_nonzero(both) < _FEWEST:
        return _Difference(0.0, 1.0)
    mean = weighted[both] / known[both]
    value = one.value[both]
    power = np.abs(value - mean) ** 2 / (one.variance[both] + 1 / known[both])
    ratio = value / mean
    middle = complex(np.median(ratio.real), np.median(ratio.imag))
    # Such powers are exponential, whose median is log 2, with a standard error of 1 / sqrt(count).
    clear = (np.median(power) - np.log(2)) * np.sqrt(np.count_nonzero(both))
    return _Difference(float(clear), middle)


def _at(frequency: Floats, etfe: Etfe) -> tuple[Complexes, Floats]:
    """The response between its own frequencies, and its variance, infinite beyond them."""
    x, own = np.log(frequency), np.log(etfe.frequency_hz)
    size = np.interp(x, own, np.log(np.abs(etfe.value)))
    phase = np.interp(x, own, np.unwrap(np.angle(etfe.value)))
    variance = np.exp(np.interp(x, own, np.log(etfe.variance)))
    beyond = (x < own[0]) | (x > own[-1])
    return np.exp(size + 1j * phase), np.where(beyond, np.inf, variance)


def _told(aside: Sequence[tuple[Etfe, _Difference]], alike: Sequence[Etfe]) -> str:
    rest = _name(alike[0]) if len(alike) == 1 else f"the {len(alike)} others"
    each = "; ".join(f"{_name(one)} {_how(own.ratio)}" for one, own in aside)
    return (
        f"The pieces do not have one response: beside that of {rest}, {each} (medians over the "
        "frequencies). What the model leaves over, and what it is said to lack, may be that "
        "difference alone. Are they of one device, held alike, in the same units, with the same "
        "delay, dry friction and size of force, none of them cut off at a limit, warmed up or made "
        "in closed loop? Report apart on what is not: leave it out of the study, or give it a "
        "configuration, a trial or a level of its own."
    )


def _how(ratio: complex) -> str:
    size, angle = abs(ratio), float(np.angle(ratio))
    if abs(angle) > _TURNED:
        text, angle = "has the opposite sign", 0.0
        if abs(size - 1) <= _NEAR:
            return text
        text += f", and is {pure(size)} times as large"
    else:
        text = f"is {pure(size)} times as large"
    for factor, why in _OF_UNITS.items():
        if abs(size / factor - 1) < _NEAR or abs(size * factor - 1) < _NEAR:
            return f"{text}, {why}" if size > 1 else f"{text}, the reverse of {why}"
    degrees = np.degrees(angle)
    least = 3.0
    if abs(degrees) < least:
        return text
    return f"{text} and {abs(degrees):.0f} degrees {'ahead' if degrees > 0 else 'behind'}"


def _name(etfe: Etfe) -> str:
    return "a piece" if etfe.recording is None else etfe.recording.name
