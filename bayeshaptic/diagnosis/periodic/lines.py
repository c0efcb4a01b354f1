"""Trials on a periodic recording: what repeats from period to period is not noise.

The residual of a steady periodic motion repeats whatever causes it, so that other periods prove
nothing.  Candidates, linear effects and internal forces alike, are fitted together with all that
was accepted before to half of the excited lines, and judged on a quarter in between.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from bayeshaptic.diagnosis import thresholds
from bayeshaptic.diagnosis.acceptance import needless
from bayeshaptic.diagnosis.battery import residual_tests
from bayeshaptic.diagnosis.periodic.balanced_state import BalancedState, sized
from bayeshaptic.diagnosis.periodic.descent import likeliest
from bayeshaptic.diagnosis.periodic.force_tests import force_tests
from bayeshaptic.diagnosis.periodic.forces import force_candidates
from bayeshaptic.diagnosis.periodic.harmonic_balance import Balanced, balance, promise
from bayeshaptic.diagnosis.periodic.joint import Basis
from bayeshaptic.diagnosis.periodic.period import one_period, with_floor
from bayeshaptic.diagnosis.periodic.steady_motion import places_of
from bayeshaptic.diagnosis.residuals.residual import Test
from bayeshaptic.diagnosis.state import (
    FIT,
    Accepted,
    State,
    Trial,
    describe_gain,
    log_likelihoods,
    share,
)
from bayeshaptic.diagnosis.trials.linear import accepted_with, sieve
from bayeshaptic.diagnosis.trials.taken_off import others
from bayeshaptic.diagnosis.trials.told_apart import told_apart
from bayeshaptic.effects.effect import LinearEffect
from bayeshaptic.effects.nonlinear.internal_force import Place
from bayeshaptic.inference.fit import Fit
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.inference.screening import starting_bases
from bayeshaptic.inference.valleys import refine_anew
from bayeshaptic.numerics.spending import Meter
from bayeshaptic.recordings.response.etfe import Etfe, compress
from bayeshaptic.recordings.response.spectra import PeriodicSpectra
from bayeshaptic.recordings.response.windows import Windows
from bayeshaptic.types import Floats

FLOOR = 0.002
"""No line is trusted to better than this share of its response while candidates are weighed."""
_PROMISE = 2.0  # to first order, on the lines to fit: forces that offer less are not tried,
_NEAR = 0.25  # nor those that offer so much less than the best one


class LineTrials:
    """How candidates are fitted to a periodic recording.

    Parameters
    ----------
    etfe : Etfe
        Periodic, with its recording.
    fit : Fit
        Of the base model.
    floor : float
        Least noise of a line, as a share of its response.
    """

    def __init__(self, etfe: Etfe, fit: Fit, floor: float = FLOOR) -> None:
        self.etfe = etfe
        self.windows, self.period = compress(with_floor(etfe, floor)), one_period(etfe)
        self.fitted = share(self.windows, FIT)
        # What lacks a force may have been fitted in another valley than the lines to fit call for.
        starts = starting_bases(fit.model, fit.theta, fit.elsewhere)
        parts = [self._balance(fit.model, (), start, np.zeros(0)) for start in starts]
        part = min(parts, key=lambda part: part.rms(self.fitted))
        whole = balance(fit.model, self.windows, self.period, (), part.theta)
        self.first = BalancedState(etfe, fit, part=part, whole=whole)

    def tests(self, state: State) -> tuple[Test, ...]:
        """The tests of its residual."""
        forces = force_tests(state.fit, state.etfe, self.period)
        return (*residual_tests(state.fit, state.etfe), *forces)

    def mended(self, state: State) -> State:
        """The state as it is: samples are averaged over the periods."""
        return state

    def explains(self, state: State, tests: tuple[Test, ...], meter: Meter) -> None:
        """None: tests of lines do not tell classes of candidates apart, so this is not asked."""

    def trials(
        self,
        state: State,
        tests: tuple[Test, ...],
        meter: Meter,
        patient: bool = True,
    ) -> list[Trial]:
        """All candidates, the best variant of each: a test does not tell their classes apart."""
        assert isinstance(state, BalancedState)
        best, found = self._linear_trials(state, meter)
        for basis in self._promising(state.part, best):
            if meter.affords(basis.title):
                meter.trying(basis.title)
                with suppress(np.linalg.LinAlgError):
                    forced = self._with_force(state, basis)
                    self._keep(found, (basis.name, basis.place), forced)
        return list(found.values())

    def beside(self, state: State) -> tuple[Test, ...]:
        """No tests: those of lines are already tests of forces fitted together."""
        return ()

    def reconsidered(self, state: State, meter: Meter) -> State:
        """The state as it is."""
        return state

    def without_needless(self, state: State, meter: Meter) -> State:
        """The state without the earlier effect that is worth least, if that is next to nothing."""
        assert isinstance(state, BalancedState)
        full = self._log_likelihoods(state.part)[1]
        worst: State = state
        least = np.inf
        for index, effect in enumerate(state.accepted[:-1]):
            try:
                tried = self._without(state.part, effect)
            except np.linalg.LinAlgError:  # without it the motion runs away: it is needed
                continue
            if tried is None:
                continue
            loss = full - self._log_likelihoods(tried)[1]
            if needless(loss, len(effect.parameters) or 1) and loss < least:
                worst, least = self._state(tried, others(state.accepted, index)), loss
        return worst

    def told_apart(self, state: State, meter: Meter) -> State:
        """With linear effects that tied before the last one was known decided beside it."""

        def trials(bare: State) -> list[Trial]:
            assert isinstance(bare, BalancedState)
            return list(self._linear_trials(bare, meter)[1].values())

        return told_apart(state, self._undone, trials)

    def _linear_trials(
        self, state: BalancedState, meter: Meter
    ) -> tuple[float, dict[tuple[str, Place | None], Trial]]:
        """The best gain of a linear effect, and the best variant of each."""
        found: dict[tuple[str, Place | None], Trial] = {}
        rest = self._rest(state.part).part(self.fitted)
        bases = starting_bases(state.part.model, state.part.theta, state.fit.elsewhere)
        sieved = sieve(state.part.model, self.etfe, rest, bases)
        best = 0.0
        for one in sieved:
            near = one.gain >= thresholds.REACH * sieved[0].gain
            if not (near and meter.affords(one.effect.title)):
                continue
            meter.trying(one.effect.title)
            with suppress(np.linalg.LinAlgError):  # a motion that runs away has no balance
                tried = self._with_linear(state.part, one.effect, one.starts, rest)
                best = max(best, self._gained(state.part, tried))
                size = len(one.effect.parameters)
                trial = self._judged(state, tried, size, accepted_with(one.effect))
                self._keep(found, (one.effect.name, None), trial)
        return best, found

    @staticmethod
    def _keep(found: dict[Any, Trial], key: Any, trial: Trial | None) -> None:
        if trial and (key not in found or trial.score > found[key].score):
            found[key] = trial

    def _gained(self, part: Balanced, tried: Balanced) -> float:
        """Gain in log likelihood on the lines to fit, the noise as large as what is left.

        In the terms of `promise`.
        """
        before, after = part.rms(self.fitted), tried.rms(self.fitted)
        return 2 * np.count_nonzero(self.fitted) * float(np.log(before / after))

    def _promising(self, part: Balanced, best: float) -> list[Basis]:
        """Forces that are not there yet and are worth a balance, the most promising first.

        What offers far less than the best of all candidates is none of them: a balance is dear.
        """
        there = {(basis.name, basis.place) for basis in part.forces}
        offers = [
            (promise(part, self.windows, self.period, basis, self.fitted), basis)
            for variants in force_candidates(part.model, part.motions).values()
            for basis in variants
            if (basis.name, basis.place) not in there
        ]
        least = max([_PROMISE, _NEAR * best, *(_NEAR * offer for offer, _ in offers)])
        offers.sort(key=lambda offer: -offer[0])
        return [basis for offer, basis in offers if offer >= least]

    def _with_force(self, state: BalancedState, basis: Basis) -> Trial | None:
        part = state.part
        forces, strength = (*part.forces, basis), np.append(part.strength, 0.0)
        tried = self._balance(part.model, forces, part.theta, strength)
        if not tried.is_possible:
            return None
        return self._judged(state, tried, 1, Accepted(basis.name, basis.title, "nonlinear", ""))

    def _with_linear(
        self, part: Balanced, effect: LinearEffect, starts: Floats, rest: Windows
    ) -> Balanced:
        model = part.model.with_effect(effect)
        theta = refine_anew(model, self.etfe, rest, starts).theta
        return self._balance(model, part.forces, theta, part.strength)

    def _judged(
        self, state: BalancedState, tried: Balanced, size: int, accepted: Accepted
    ) -> Trial:
        gains = self._log_likelihoods(tried) - self._log_likelihoods(state.part)
        gain_fit, gain_choose = gains.tolist()
        accepted = replace(accepted, evidence=describe_gain(gain_choose))
        changed: State = replace(state, accepted=(*state.accepted, accepted))
        if thresholds.convincing(gain_fit, gain_choose, size):
            changed = self._state(tried, changed.accepted)
            accepted = changed.accepted[-1]
        return Trial(accepted, changed, gain_fit, gain_choose, size)

    def _balance(
        self, model: Any, forces: tuple[Basis, ...], theta: Floats, strength: Floats
    ) -> Balanced:
        return likeliest(model, self.windows, self.period, forces, theta, strength, self.fitted)

    def _without(self, part: Balanced, effect: Accepted) -> Balanced | None:
        """Everything else fitted anew to the lines to fit; None where a force acts on its mass."""
        if effect.change is not None and effect.change.effect is not None:
            kept = [name not in effect.parameters for name in part.model.names]
            model, theta = part.model.without_effect(effect.change.effect), part.theta[kept]
            places = places_of(model.system(theta))
            if any(basis.place not in places for basis in part.forces):
                return None
            return self._balance(model, part.forces, theta, part.strength)
        own = [basis.title != effect.title for basis in part.forces]
        forces = tuple(basis for basis, stays in zip(part.forces, own, strict=True) if stays)
        return self._balance(part.model, forces, part.theta, part.strength[own])

    def _undone(self, state: State, index: int) -> State | None:
        """The state without the accepted effect of an index; None where nothing holds then."""
        assert isinstance(state, BalancedState)
        with suppress(np.linalg.LinAlgError):
            if (tried := self._without(state.part, state.accepted[index])) is not None:
                return self._state(tried, others(state.accepted, index))
        return None

    def _rest(self, balanced: Balanced) -> Windows:
        """The lines without what internal forces add."""
        return replace(self.windows, target=self.windows.target - balanced.added[:, None])

    def _log_likelihoods(self, balanced: Balanced) -> Floats:
        return log_likelihoods(balanced.model, self._rest(balanced), balanced.theta)

    def _state(self, part: Balanced, accepted: tuple[Accepted, ...]) -> BalancedState:
        """The recording's spectra less the forces' motion, and a fit to all lines."""
        spectra = self.etfe.spectra
        assert isinstance(spectra, PeriodicSpectra)
        whole = likeliest(
            part.model, self.windows, self.period, part.forces, part.theta, part.strength
        )
        own = replace(spectra, position=spectra.position - whole.added)
        # What a person sees, without it too.
        value = self.etfe.value - whole.added / spectra.force
        corrected = replace(self.etfe, spectra=own, value=value)
        fit = least_squares(whole.model, corrected, start=whole.theta)
        return BalancedState(corrected, fit, sized(accepted, whole), part=part, whole=whole)
