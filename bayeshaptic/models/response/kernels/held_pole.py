"""A pole in the closed form, behind a hold and part of a period.

In plain NumPy it is `from_poles` of `tests/references/plain_response.py`.

Kernels elsewhere contain it: they are to be compiled anew where it is changed.
"""

from __future__ import annotations

import math

from bayeshaptic.compiled import kernel

_TINY = 1e-8


@kernel(inline=True)
def held_pole(p: complex, r: complex, late: float) -> tuple[complex, complex, complex]:
    """Numerators without and with a further z^-1, and what is subtracted from z - 1.

    Of a pole p and its residue r, times T each, `late` periods behind.
    """
    early = 1.0 - late
    direct = r * early * _phi(p * early)
    return direct, r * _exp(p * early) * late * _phi(p * late), _expm1(p)


@kernel(inline=True)
def _phi(x: complex) -> complex:
    """(e^x - 1) / x, and 1 at x = 0."""
    return 1.0 + 0.5 * x if abs(x) < _TINY else _expm1(x) / x


@kernel(inline=True)
def _exp(x: complex) -> complex:
    size = math.exp(x.real)
    if x.imag == 0.0:
        return complex(size, 0.0)
    return complex(size * math.cos(x.imag), size * math.sin(x.imag))


@kernel(inline=True)
def _expm1(x: complex) -> complex:
    """e^x - 1 without cancellation."""
    less = math.expm1(x.real)
    if x.imag == 0.0:
        return complex(less, 0.0)
    half = math.sin(0.5 * x.imag)
    return complex(less * math.cos(x.imag) - 2.0 * half * half, (less + 1.0) * math.sin(x.imag))
