"""Parameters where something stays unexplained: wide enough for what it does to the response."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from fake_analysis import _tests
from right_fit import right_fit

from bayeshaptic.diagnosis.residuals.overdispersion import noise_scale
from bayeshaptic.diagnosis.traced import EXPLAINED, UNEXPLAINED
from bayeshaptic.diagnosis.widening import rest
from bayeshaptic.diagnosis.widening.deviation import Deviation, evidence, matern, modelled
from bayeshaptic.diagnosis.widening.rest import BENDS, with_rest
from bayeshaptic.inference.around_fit import draws_around
from bayeshaptic.inference.fit import Fit, summarise
from bayeshaptic.inference.least_squares import polish
from bayeshaptic.inference.posterior import Posterior


@pytest.fixture(scope="module")
def clean() -> Fit:
    return right_fit()


def left(family: str, verdict: str = UNEXPLAINED) -> Any:
    return SimpleNamespace(verdict=verdict, after=_tests(90.0, family))


def recorded_again(fit: Fit, size: float, rng: np.random.Generator) -> Fit:
    """Other noise, and a response that is bent smoothly by `size`; fitted again."""
    windows = fit.windows
    log_f = np.log10(windows.frequency_hz.mean(axis=1))
    between = log_f[:, None] - log_f[None, :]
    values, vectors = np.linalg.eigh(matern(between, 0.4))
    normal = rng.standard_normal((2, len(log_f))) / np.sqrt(2)
    bent = size * vectors @ (np.sqrt(np.maximum(values, 0)) * (normal[0] + 1j * normal[1]))
    noise = rng.standard_normal((2, *windows.target.shape)) / np.sqrt(2)
    sd = np.sqrt(fit.likelihood.noise_variance)[:, None]
    target = modelled(fit) * (1 + bent[:, None]) + sd * (noise[0] + 1j * noise[1])
    windows = replace(windows, target=target)
    return summarise(fit.model, windows, polish(fit.model, windows, fit.theta))


def stated(fit: Fit) -> Posterior:
    """Draws as with the noise that a misfit makes a posterior take."""
    chi_square = max(fit.reduced_chi_square, 1.0)
    return draws_around(replace(fit, covariance=fit.covariance * noise_scale(fit) / chi_square))


def held(posterior: Posterior, truth: np.ndarray) -> np.ndarray:
    low, high = posterior.quantile(np.array([0.05, 0.95]))
    return (low <= truth) & (truth <= high)


def test_parameters_of_a_response_that_is_bent_smoothly_are_held(clean: Fit) -> None:
    """Of 80 such recordings, at 5 %: mass, damping and delay go with the same bend."""
    rng = np.random.default_rng(11)
    narrow, wide = [], []
    for _ in range(80):
        fit = recorded_again(clean, 0.05, rng)
        posterior = stated(fit)
        found = with_rest(posterior, fit, left("linear"), noise_scale(fit))
        assert found is not None
        narrow.append(held(posterior, clean.theta))
        wide.append(held(found, clean.theta))
    # 90 % of 80 is 72 +- 2.7; three parameters that hardly depend on each other 216 +- 5.
    assert np.sum(wide) >= 200
    assert np.sum(narrow) < np.sum(wide) - 20


def test_what_acts_as_noise_bends_by_a_share_of_its_scatter(clean: Fit) -> None:
    posterior = draws_around(clean)

    def more(fit: Fit) -> np.ndarray:
        found = with_rest(posterior, fit, left("nonlinear"))
        assert found is not None
        return found.draws.var(axis=0) - posterior.draws.var(axis=0)

    louder = replace(clean.windows, scatter=4 * clean.windows.scatter)
    once, twice = more(clean), more(summarise(clean.model, louder, clean.theta))
    mass = clean.model.names.index("m")
    assert once[mass] > 0
    # Twice the scatter, and weights that all fall alike: twice the bend, four times the variance.
    assert twice[mass] / once[mass] == pytest.approx(4.0, rel=0.1)
    assert 0 < BENDS < 1


def test_noise_that_was_taken_louder_is_not_counted_again(clean: Fit) -> None:
    posterior = draws_around(clean)
    found = with_rest(posterior, clean, left("nonlinear"), louder=1e9)
    assert found is not None
    assert found.draws == pytest.approx(posterior.draws, rel=1e-9)


def test_what_jumps_from_window_to_window_is_no_bend(clean: Fit) -> None:
    """White noise of three times the fit's own, which a smooth function cannot be."""
    rng = np.random.default_rng(4)
    log_f = np.linspace(0, 2, 400)
    smooth, noise, jumps = 0.3 * np.sin(4 * log_f), 1e-3, 3e-3
    normal = rng.standard_normal((2, 2, len(log_f))) / np.sqrt(2)
    white = [one + 1j * other for one, other in normal]
    variance = np.full(len(log_f), noise**2)
    quiet = Deviation(log_f, smooth + noise * white[0], variance)
    loud = replace(quiet, value=quiet.value + jumps * white[1])
    assert quiet.jumps < 0.2 * noise**2
    # Of 398 differences that share windows: known to some 8 %.
    assert loud.jumps == pytest.approx(jumps**2, rel=0.25)
    louder = replace(loud, variance=loud.variance + loud.jumps)
    sizes = [np.dot(w, [size for size, _ in cases]) for cases, w in map(evidence, (loud, louder))]
    assert sizes[1] < 0.5 * sizes[0]


def test_parameters_that_the_data_cannot_tell_apart_are_widened(
    clean: Fit, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of friction that holds a device: the square of such slopes was not positive definite."""
    posterior, slopes = draws_around(clean), rest._slopes
    for size in np.geomspace(1e4, 1e9, 20):

        def alike(fit: Fit, here: Any, size: float = size) -> np.ndarray:
            same = size * slopes(fit, here)
            same[..., 1] = same[..., 0]
            return same

        monkeypatch.setattr(rest, "_slopes", alike)
        found = with_rest(posterior, clean, left("nonlinear"))
        assert found is not None
        assert np.all(np.isfinite(found.draws))


def test_what_is_explained_widens_nothing(clean: Fit) -> None:
    posterior = draws_around(clean)
    assert with_rest(posterior, clean, left("nonlinear", EXPLAINED)) is None
