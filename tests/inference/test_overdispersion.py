"""How much noise a posterior takes where the model misfits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bayeshaptic.diagnosis.residuals.overdispersion import correlation_length, noise_scale
from bayeshaptic.inference.fit import Fit
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.models import rigid
from bayeshaptic.recordings import recording_from_arrays
from bayeshaptic.recordings.response.estimate import estimate_etfe
from bayeshaptic.rig import Bench, WhiteNoise, simulate


def fitted() -> Fit:
    """A rigid device, and the model that is right."""
    bench = Bench("rigid", {"m": 2.0, "b": 20.0}, delay_s=5e-4, encoder_resolution=1e-6)
    made = simulate(bench, WhiteNoise(5.0, 400.0, 0.5, 20.0), seed=3)
    recording = recording_from_arrays(**made.signals)
    return least_squares(rigid(period_s=1e-3), estimate_etfe(recording))


def test_a_residual_that_goes_on_counts_less_than_one_that_scatters() -> None:
    fit = fitted()
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
