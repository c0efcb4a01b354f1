"""What is done here to spare the import of SciPy's optimisers, integrals and splines."""

import numpy as np
from scipy.integrate import cumulative_simpson
from scipy.interpolate import RegularGridInterpolator
from scipy.optimize import nnls

from bayeshaptic.models.prior_of_zero import _integrated
from bayeshaptic.recordings.signals.rough_response import _left_by_two
from bayeshaptic.report.figures import pairs


def test_two_factors_that_are_not_negative():
    rng = np.random.default_rng(3)
    for columns, one in zip(
        rng.standard_normal((200, 12, 2)), rng.standard_normal((200, 12)), strict=True
    ):
        columns = columns / np.linalg.norm(columns, axis=0)
        assert np.isclose(_left_by_two(columns, one), nnls(columns, one)[1] ** 2, rtol=1e-12)


def test_integrals_up_to_each_point():
    x = np.linspace(0.0, 7.0, 401)
    density = np.exp(-x) * np.sin(x) ** 2
    theirs = cumulative_simpson(density, x=x, initial=0.0)
    assert np.allclose(_integrated(density, x[1]), theirs, rtol=1e-13, atol=1e-15)


def test_heights_between_the_middles_of_cells():
    x, y = np.random.default_rng(4).standard_normal((2, 3000))
    count, *edges = np.histogram2d(x, y, 24)
    middles = tuple(0.5 * (edge[1:] + edge[:-1]) for edge in edges)
    height = RegularGridInterpolator(
        middles, pairs._smooth(count), bounds_error=False, fill_value=0.0
    )
    theirs = np.quantile(height(np.column_stack([x, y])), [1 - level for level in pairs.LEVELS])
    assert np.allclose(pairs.credible(count, *edges, x, y), theirs, rtol=1e-12)
