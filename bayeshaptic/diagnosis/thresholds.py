"""Every number that decides what closing the loop finds, believes, and lets pass.

Where a statistic has a known distribution under the model, its threshold follows from a rate of
false alarms.  The others are in their own units.  Rates measured on clean recordings, and what each
test finds, are in docs/statistics.md; ``benchmarks/thresholds.py`` makes that table, and
``benchmarks/acceptance.py`` that of the rules of acceptance.
"""

from __future__ import annotations

import numpy as np
from scipy.special import ndtri

# ---------------------------------------------------------------- tests of the residual

FALSE_ALARM = 1e-5
"""Chance that one test of a statistic with a known distribution is flagged on a clean recording.

A recording gets some fifteen tests, and no distribution is known that far out: hence so small."""

SMOOTH = 5.0
"""Score of a smooth change of the response.  Its distribution is known, too, for a response that is
a parabola in every window; beside a sharp resonance it is not quite, and long recordings see it."""


def normal(tries: float = 1.0) -> float:
    """Threshold of the largest of so many standard normal scores, at `FALSE_ALARM` in all."""
    return float(-ndtri(-np.expm1(np.log1p(-FALSE_ALARM) / tries)))


def two_sided() -> float:
    """Threshold of the magnitude of a standard normal score."""
    return normal(2.0)


LOG_CHANCE = 5.0
"""Of a tone: -log10 of the chance that any line of noise stands out as far (tones)."""

EXCESS_DB = 6.0
"""Noise in the driven band over that beyond it, dB: three windows of noise scatter by some 1 dB."""
CLIPPED = 6.0
"""Distance that the motion led beyond an extreme, in errors of the prediction."""
HELD = 10.0
"""Samples that repeat the one before although the device moved on, less those off by chance."""
LOST, WILD = 4.0, 4.0
"""Missing rows, and wild samples by how far off they are; each is beyond doubt (faults)."""
OUTSIDE = 10.0
"""Mean square of the errors in the least clear of a few moments, over the usual one (outside).

Of 160 clean recordings and 1,124 others two are above (docs/effects.md); the next has 7.3."""
JITTER, JITTER_STAMPED = 7.0, 2.5
"""Rise of the noise with the speed, in standard deviations from blocks of samples; the second
where the time stamps show jitter already."""
RESOLUTION = 1.5
"""Found count of the encoder over the declared one."""

# ---------------------------------------------------------------- acceptance
# Each rule was left out by itself, of 24 clean recordings and 34 with an effect, all candidates of
# all classes tried (benchmarks/acceptance.py; docs/statistics.md): whichever it is, nothing is
# accepted on a clean one, and none costs a name. "Without it" below says what else changes.

ENOUGH = 8.0
"""Least gain in log likelihood on windows that took no part in the fit: e^8 to one.

Without it nothing changes: the next two stand behind it, as it does behind each of them."""
SHARE = 0.15
"""Least held-out gain over that on the windows fitted to.

The windows to choose by are half as many, so that a true effect brings half of the gain; an effect
that is overfitted brings next to nothing."""
A_PARAMETER = 2.0
"""Held-out gain that a parameter must bring (twice Akaike's, on half as many windows)."""
RIVAL = 0.85
"""Share of the best score from which on a candidate may be the better explanation.

Without it nothing changes."""
TIE, LAW_TIE = 6.0, 0.05
"""Difference of scores that one recording does not decide; of laws of one force, which differ by
less than either does from the truth, this share of the score besides.

Without the first 30 of 34 effects are named, or stand as a tie; with it 33.  Without the second
nothing changes."""
LAW_SD = 0.03
"""How well a law of a force is known at best, relative; nor is its strength known better.

Chosen.  With it all 19 intervals (90 %) that 40 rubbing loops got hold the limit."""
FARTHEST = 2.3
"""Log stiffness that what is left, or a ripple, may move a limit by at most: a factor of ten."""
LAW_REST = 3.0
"""What one law of a force may leave more than another by chance, in thresholds.

Without it nothing changes; nor without the next."""
LEAST = 1.2
"""Factor on the least that a candidate leaves up to which another leaves as little."""
WORSE = 1.2
"""Factor by which the held-out error may rise; an explanation that raises it further is none.

A quarter of the windows of a third of a recording knows its error to some 10 %.  Without it nothing
changes."""

# ---------------------------------------------------------------- what an effect may leave

MENDED = 1.5
"""Factor on the thresholds of a recording that something was taken off, or a part of one.

Without it nothing changes: it is for a second round, and for recordings that are mended."""

# ---------------------------------------------------------------- what is worth trying

REACH = 0.3
"""Share of the best candidate's gain after a cheap fit below which none is fitted in full.

The right one of 62 of 64 recordings with a linear effect is followed, and a third of all; from a
twentieth on it were 63, and half of all."""


def convincing(gain_fit: float, gain_choose: float, size: int) -> bool:
    """Whether a candidate of `size` parameters predicts what it was not fitted to.

    And explains what it was fitted to: these are twice as many windows, so that an effect that is
    worth less there has gained elsewhere by chance.  Of 46 recordings with promised effects
    (``benchmarks/costs/reports.py``) 45 are explained with that, or consistent, and of the 30 that
    were run without it each is what it was.

    Parameters
    ----------
    gain_fit, gain_choose : float
        Gain in log likelihood on the windows that it was fitted to, and on those it was not.
    size : int
    """
    enough = max(ENOUGH, SHARE * gain_fit, A_PARAMETER * size)
    return gain_choose > enough and gain_fit > ENOUGH
