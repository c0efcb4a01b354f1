"""Whether a vibration mode in a band of few windows may as well lie above the band.

What a reference moves may be a few windows of slow motion.  A mode among them can follow their
noise better than the device does, whose own mode lies above the band; draws around the one never
see the other.  This is not asked where nearly all frequencies are moved, as in open loop.  Of 96
free devices in closed loop 57 were read through the reference; three were doubted for it, and their
intervals all lay wholly above the truth.  Of 66 that are read now, seven are doubted, and their
intervals all hold.
"""

from __future__ import annotations

import numpy as np
from scipy.special import chdtri

from bayeshaptic.errors import Notice
from bayeshaptic.inference.fit import Fit
from bayeshaptic.inference.least_squares import polish
from bayeshaptic.quantities import quantity
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.stability.critical import CriticalStiffness, critical_stiffness

VALLEY = "valley"  # the notice's topic
_ABOVE = (1.5, 2.5, 4.0)  # times the band's upper end: where the mode may lie instead
_LOADS = (0.15, 0.4)  # shares of the mass behind the connection
# The best fit is better than the truth by half a chi-square of the parameters; in one of a thousand
# recordings by more than this.
_CHANCE = 0.999


def mode_above_band(fit: Fit, etfe: Etfe, limit: CriticalStiffness) -> tuple[Notice, ...]:
    """A warning where a mode above the band explains as much, and the limit is another then.

    Parameters
    ----------
    fit : Fit
    etfe : Etfe
        Read through a reference.
    limit : CriticalStiffness
        Of draws around the fit.
    """
    model, theta = fit.model, fit.theta
    own = dict(zip(model.names, theta, strict=True))
    if not {"m1", "m2", "kc", "bc"} <= own.keys():
        return ()
    top, mass = etfe.band_hz[1], own["m1"] + own["m2"]
    least = fit.likelihood(theta[None])[0] - 0.5 * float(chdtri(model.size, 1 - _CHANCE))
    low, high = (float(limit.quantile(p)) for p in (0.05, 0.95))
    for share in _LOADS:
        for factor in _ABOVE:
            between = share * (1 - share) * mass
            omega = 2 * np.pi * factor * top
            moved = {"m1": (1 - share) * mass, "m2": share * mass, "kc": between * omega**2}
            moved["bc"] = 0.05 * between * omega
            start = np.array([moved.get(name, value) for name, value in own.items()])
            found = polish(model, fit.windows, start)
            there = float(critical_stiffness(model, found).value)
            if fit.likelihood(found[None])[0] > least and not low <= there <= high:
                return (_told(there, limit.unit, len(fit.windows.scatter)),)
    return ()


def _told(limit: float, unit: str, windows: int) -> Notice:
    text = (
        f"The reference moves {windows} windows of frequencies, and a vibration mode above them "
        f"explains these as well as one among them, with a limit of {quantity(limit, unit)}."
    )
    return Notice("warning", VALLEY, text)
