"""Closed loops whose leakage is the device's own motion: what leaks is known, and hides nothing.

A record that does not end as it began leaks into all lines of its spectrum.  In every window
anything smooth is taken for that, which is right whatever the noise is, and takes most from the
lowest windows: there a controller that follows steps or ramps moves the most.  Where nobody holds a
device and its noise is the encoder's, which leaks nothing, what leaks is a free motion, with the
poles of the device and a few coefficients for the whole record.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.stats import f

from bayeshaptic.diagnosis.residuals.causal import causal_tests
from bayeshaptic.diagnosis.state import State
from bayeshaptic.inference.fit import Fit
from bayeshaptic.inference.least_squares import continued
from bayeshaptic.inference.valleys import refine
from bayeshaptic.models.start import starting_points
from bayeshaptic.recordings.response.estimators.direct import DirectSpectra, free_motions
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.recordings.response.local_polynomial import LEAKAGE_TERMS

# Fits around the poles of the last one until they settle: most take two or three.
_ROUNDS, _SETTLED = 6, 0.05
# Sets of starting points, and log likelihood by which they must lead to more than the same valley.
_SETS, _LIKELIER = 2, 1.0
# Probability with which windows that show no other leakage are taken for such that do, and how
# many are asked: leakage falls with the frequency. Of 2000 noises 4 are.
_BY_CHANCE, _LOWEST = 1e-3, 8


def by_free_motion(state: State) -> State | None:
    """The fit of a closed loop again, with the device's free motion for all leakage.

    Parameters
    ----------
    state : State
        Of the direct method.

    Returns
    -------
    State or None
        None where somebody holds the device, where a force was taken off its motion, and where the
        fit does not settle, leakage is left, or a test sees more than noise.
    """
    fit = state.fit
    if fit.model.held or any(effect.family != "linear" for effect in state.accepted):
        return None
    if not fit.model.system(fit.theta).has_rational_form:
        return None
    found = _settled(fit, state.etfe)
    if found is None or not _stands(*found):
        return None
    better = _from_other_starts(*found)
    if better is not None:
        found = _settled(better, state.etfe)
        if found is None or not _stands(*found):
            return None
    return replace(state, etfe=found[1], fit=found[0])


def _from_other_starts(fit: Fit, etfe: Etfe) -> Fit | None:
    """Where likelier a valley is found, now that lines tell more: a fit to go on from."""
    best: Fit | None = None
    for number in range(_SETS):
        starts = starting_points(fit.model, etfe, np.random.default_rng([0, number]))
        found = refine(fit.model, fit.windows, starts)
        there = fit.at(found.theta)
        if there.log_likelihood > (best or fit).log_likelihood + _LIKELIER:
            best = replace(there, alike=found.alike)
    return best


def _stands(fit: Fit, etfe: Etfe) -> bool:
    """Whether nothing is left that such leakage does not explain."""
    return not (
        fit.impossible
        or leaks_more(fit, etfe)
        or any(test.flagged for test in causal_tests(fit, etfe))
    )


def _settled(fit: Fit, etfe: Etfe) -> tuple[Fit, Etfe] | None:
    """The fit with the free motions of its own poles, and its spectra; None where it wanders."""
    for _ in range(_ROUNDS):
        known = _with_motion_of(fit, etfe)
        last, fit = fit, continued(fit, known)
        if np.nanmax(np.abs(fit.theta - last.theta) / fit.sd) < _SETTLED:
            return fit, known
    return None


def _with_motion_of(fit: Fit, etfe: Etfe) -> Etfe:
    """The spectra with the free motions of a fit; encoders make the same noise at all lines."""
    spectra = etfe.spectra
    assert isinstance(spectra, DirectSpectra)
    system = fit.model.system(fit.theta)
    poles, delay_s = system.poles()[0][0], float(system.delay_s[0])
    assert fit.model.period_s is not None
    own = free_motions(poles, delay_s, fit.model.period_s, spectra.frequency_hz)
    return replace(etfe, spectra=replace(spectra, free_motions=own, noise_slope=None))


def leaks_more(fit: Fit, etfe: Etfe) -> bool:
    """Whether what is left in the lowest windows is more like leakage than noise is."""
    spectra = etfe.spectra
    assert isinstance(spectra, DirectSpectra)
    plain = replace(spectra, free_motions=None)
    lines, inside, leakage = plain.free(slice(0, _LOWEST), response=False)
    basis = np.linalg.qr(leakage)[0]
    left = (spectra.left(fit.response)[lines] * inside)[..., None]
    like_it = np.sum(np.abs(np.swapaxes(basis.conj(), -1, -2) @ left) ** 2, axis=(1, 2))
    beside = np.sum(np.abs(left) ** 2, axis=(1, 2)) - like_it
    freedom = inside.sum(axis=1) - LEAKAGE_TERMS
    ratio = (like_it / LEAKAGE_TERMS) / (beside / freedom)
    chance = f.sf(ratio, 2 * LEAKAGE_TERMS, 2 * freedom)
    return bool(chance.min() < _BY_CHANCE / len(chance))
