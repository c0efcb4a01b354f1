"""How much noise a posterior must take where the model misfits: the residual's size and order.

What a model lacks leaves a residual that goes on from one frequency to the next: as many
neighbouring windows as deviate alike count as one.
"""

from __future__ import annotations

import numpy as np

from bayeshaptic.inference.fit import MISFIT, Fit


def noise_scale(fit: Fit) -> float:
    """Factor on the noise variance of a posterior around `fit`; 1 where the model fits.

    The reduced chi-square, times the correlation length of the residual over the windows, in
    windows: the variance of a sum over that of as many independent numbers.
    """
    if fit.reduced_chi_square <= MISFIT:
        return 1.0
    return fit.reduced_chi_square * correlation_length(fit)


def correlation_length(fit: Fit) -> float:
    """1 + twice the sum of the correlations between windows until they vanish.

    Of the relative deviation in every window: the part of what is left that is as the response is.
    """
    windows = fit.windows
    nodes = windows.frequency_hz
    response = fit.response(nodes)
    fitted = np.einsum("wij,wj->wi", windows.design[:, :, : nodes.shape[1]], response)
    left = windows.target - fitted
    sd = np.sqrt(windows.scatter / np.maximum(windows.lines - 2, 0.5))
    size = np.linalg.norm(fitted, axis=1)
    deviation = np.einsum("wi,wi->w", fitted.conj(), left) / np.maximum(size * sd, 1e-300)
    deviation = deviation[np.argsort(nodes.mean(axis=1), kind="stable")]
    count = len(deviation)
    padded = np.fft.fft(deviation, 2 * count)
    furthest = 0.25  # of the windows: how far apart neighbours may be
    sums = np.fft.ifft(np.abs(padded) ** 2).real[: max(int(furthest * count), 2)]
    if not sums[0] > 0:
        return 1.0
    correlation = sums[1:] / sums[0]
    gone = np.flatnonzero(correlation < 2 / np.sqrt(count))
    kept = correlation[: gone[0]] if len(gone) else correlation
    return float(1 + 2 * kept.sum())
