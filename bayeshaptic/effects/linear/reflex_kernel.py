"""The compiled part of `reflex.py`: its law on the imaginary axis."""

from __future__ import annotations

from bayeshaptic.compiled import kernel
from bayeshaptic.numerics.cos_sin import cos_sin
from bayeshaptic.types import Floats


@kernel
def on_axis(
    omega: Floats, stiffness: Floats, damping: Floats, delay_s: Floats, lag_s: Floats, out: Floats
) -> None:
    """(k + b s) e^(-s delay) / (1 + s lag) at s = j omega.

    Parameters
    ----------
    omega : ndarray, shape (L, B)
    stiffness, damping, delay_s, lag_s : ndarray, shape (B,)
    out : ndarray, shape (L, B, 2)
        Real and imaginary parts.
    """
    for line in range(omega.shape[0]):
        for b in range(omega.shape[1]):
            w = omega[line, b]
            cosine, sine = cos_sin(w * delay_s[b])
            late = w * lag_s[b]
            force, force_j = stiffness[b], w * damping[b]
            # over 1 + j late, then turned by the delay
            size = 1.0 / (1.0 + late * late)
            re = size * (force + force_j * late)
            im = size * (force_j - force * late)
            out[line, b, 0] = re * cosine + im * sine
            out[line, b, 1] = im * cosine - re * sine
