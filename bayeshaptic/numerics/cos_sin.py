"""Cosine and sine in plain arithmetic, of which the compiler makes vector instructions.

Kernels elsewhere contain it: they are to be compiled anew where it is changed.
"""

from __future__ import annotations

import numpy as np

from bayeshaptic.compiled import kernel


@kernel(inline=True)
def cos_sin(x: float) -> tuple[float, float]:
    """Both at once, in plain arithmetic; the constants are those of fdlibm."""
    k = np.rint(x * 0.6366197723675814)
    r = (
        (x - k * 1.57079632673412561417) - k * 6.07710050630396597660e-11
    ) - k * 2.0222662487959506e-21
    z = r * r
    sine = r + r * z * (
        -1.66666666666666324348e-01
        + z
        * (
            8.33333333332248946124e-03
            + z
            * (
                -1.98412698298579493134e-04
                + z
                * (
                    2.75573137070700676789e-06
                    + z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)
                )
            )
        )
    )
    cosine = (
        1.0
        - 0.5 * z
        + z
        * z
        * (
            4.16666666666666019037e-02
            + z
            * (
                -1.38888888888741095749e-03
                + z
                * (
                    2.48015872894767294178e-05
                    + z
                    * (
                        -2.75573143513906633035e-07
                        + z * (2.08757232129817482790e-09 - z * 1.13596475577881948265e-11)
                    )
                )
            )
        )
    )
    quarter = k - 4.0 * np.floor(0.25 * k)
    odd = quarter == 1.0 or quarter == 3.0
    c = sine if odd else cosine
    s = cosine if odd else sine
    c = -c if quarter == 1.0 or quarter == 2.0 else c
    s = -s if quarter >= 2.0 else s
    return c, s
