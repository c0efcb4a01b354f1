"""The force that a linear model leaves over, as a curve over velocity, position or stretch.

The residual force surface of S. F. Masri and T. K. Caughey (J. Appl. Mech. 46, 1979), one variable
at a time.  The curve is piecewise linear, and its ordinates are fitted to all windows at once with
the weights of the likelihood: binning U - Y/G over time instead would drown it in the encoder's
noise, which grows with the square of the frequency.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bayeshaptic.diagnosis.residuals.columns import response_to
from bayeshaptic.diagnosis.residuals.lines import Lines
from bayeshaptic.inference.fit import Fit
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.types import Complexes, Floats

# Dense about zero, where friction turns round; no wider than the motion often is.
_KNOTS = np.array([-2.2, -1.3, -0.7, -0.3, -0.08, 0.08, 0.3, 0.7, 1.3, 2.2])
_EDGES = (0.003, 0.997)  # share of the time outside of which no knot stands


@dataclass(frozen=True)
class ForceCurve:
    """A force on the device that the linear model does not hold.

    Attributes
    ----------
    over : str
        "velocity" and "position" of the motor, "stretch" of the connection, or "command".
    motion : ndarray, shape (K,)
        Position units, position units a second, or force units.
    force, sd : ndarray, shape (K,)
        Force units; its mean over the recording is zero, because a constant cannot be seen.
    """

    over: str
    motion: Floats
    force: Floats
    sd: Floats


def force_curve(
    fit: Fit, etfe: Etfe, over: str, motion: Floats, times: Floats | float = 1.0
) -> ForceCurve:
    """The force that `fit` leaves over in `etfe`, as a curve over a motion.

    Parameters
    ----------
    fit : Fit
    etfe : Etfe
        Of a recording with random excitation.
    over : str
        One of the variables of `bayeshaptic.effects.nonlinear.shapes`.
    motion : ndarray, shape (N,)
        As `motions` gives it.
    times : ndarray, shape (N,), or float
        What a value of the curve is multiplied by: of damping along the way the velocity over its
        rms.
    """
    assert etfe.recording is not None
    low, high = np.quantile(motion, _EDGES)
    knots = _KNOTS * motion.std()
    knots = knots[(knots > low) & (knots < high)]
    if not len(knots):  # of a motion that hardly turns round
        knots = np.array([low, high])
    hats = [np.interp(motion, knots, row) for row in np.eye(len(knots))]
    at_lines = Lines.of(etfe, etfe.recording)
    response = response_to(fit, over, at_lines.s)
    columns = np.stack([response * at_lines(times * hat) for hat in hats])
    force, covariance = _weighted(fit, etfe, columns)
    # A constant force has no line in the band: what is drawn has mean zero over time.
    centre = np.eye(len(knots)) - np.mean(hats, axis=1)[None, :]
    sd = np.sqrt(np.maximum(np.diag(centre @ covariance @ centre.T), 0))
    return ForceCurve(over, knots, centre @ force, sd)


def _weighted(fit: Fit, etfe: Etfe, columns: Complexes) -> tuple[Floats, Floats]:
    """Real coefficients of the columns in what the fit leaves over, and their covariance."""
    windows = etfe.spectra.windows(fit.response, columns)
    count = len(columns)
    nodes = windows.frequency_hz.shape[1]
    g = fit.response(windows.frequency_hz)
    left = windows.target - np.einsum("wij,wj->wi", windows.design[:, :, :nodes], g)
    freedom = np.maximum(windows.lines - nodes - count, 1.0)
    weight = np.sqrt(2 * freedom / windows.scatter)  # of real and imaginary part
    rows = weight[:, None, None] * windows.design[:, :, nodes:]
    target = weight[:, None] * left
    a = np.concatenate([rows.real.reshape(-1, count), rows.imag.reshape(-1, count)])
    b = np.concatenate([target.real.ravel(), target.imag.ravel()])
    inverse = np.linalg.pinv(a, rcond=1e-6)
    return inverse @ b, inverse @ inverse.T
