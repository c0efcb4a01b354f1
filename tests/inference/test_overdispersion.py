"""How much noise a posterior takes where the model misfits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from right_fit import right_fit

from bayeshaptic.diagnosis.residuals.overdispersion import correlation_length, noise_scale
from bayeshaptic.inference.fit import Fit


def test_a_residual_that_goes_on_counts_less_than_one_that_scatters() -> None:
    fit = right_fit()
    assert noise_scale(fit) == 1.0
    windows = fit.windows
    nodes = windows.frequency_hz
    count = len(nodes)
    response = fit.response(nodes.ravel()).reshape(nodes.shape)
    fits = np.einsum("wij,wj->wi", windows.design, response)
    size = np.sqrt(np.sum(np.abs(fits) ** 2, axis=1) / windows.scatter)

    def lacking(deviation: np.ndarray) -> Fit:
        """With a relative deviation of the response in every window, in units of its noise."""
        target = fits * (1 + 30 * (deviation / size)[:, None])
        return replace(fit, windows=replace(windows, target=target), reduced_chi_square=100.0)

    rng = np.random.default_rng(0)
    scattered = lacking(rng.standard_normal(count) + 1j * rng.standard_normal(count))
    assert 1.0 <= correlation_length(scattered) < 1.5
    # The correlation of a sine over the windows falls to zero in a quarter of its period.
    waves = lacking(np.sin(2 * np.pi * np.arange(count) / 40) + 0j)
    assert 10 < correlation_length(waves) < 16  # 40 / pi
    assert noise_scale(waves) == 100.0 * correlation_length(waves)
