"""From warm ensembles to chains that are enough."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.inference.sampling.ensembles import ENSEMBLES, WALKERS, Ensembles, refitted
from bayeshaptic.inference.sampling.near_zero import Redraw
from bayeshaptic.inference.sampling.several_peaks import restored
from bayeshaptic.inference.sampling.stopping import Rule, Verdict
from bayeshaptic.types import Floats, LogDensity, Progress

_FIRST_STEPS = 32  # before chains are looked at for the first time
_MIXED = 0.06  # effective draws a draw, an autocorrelation of 16 steps: below, a proposal is refit
# Share of the draws asked for from which on as many evaluations again are forecast to be enough.
_NEARLY = 0.5


@dataclass
class Run:
    """Chains so far, and everything that decides how they go on.

    Attributes
    ----------
    ensembles : Ensembles
    rng : Generator
        Of refitted proposals.
    chains : ndarray, shape (ensembles, steps, walkers, P)
        Kept steps, in sampling coordinates.
    values : ndarray, shape (ensembles, steps, walkers)
        Log densities there.
    more : int
        Steps that are to be kept next.
    every : int
        Steps of which one is kept.
    refits : int
    """

    ensembles: Ensembles[Any]
    rng: np.random.Generator
    chains: Floats = field(default_factory=lambda: np.empty(0))
    values: Floats = field(default_factory=lambda: np.empty(0))
    more: int = _FIRST_STEPS
    every: int = 1
    refits: int = 0

    @property
    def steps(self) -> int:
        """Kept so far."""
        return self.values.shape[1] if self.values.size else 0

    def advance(self) -> None:
        """Go on for as many steps as were found to be needed."""
        found = self.ensembles.advance(self.more, self.every)
        before = [(self.chains, self.values)] if self.steps else []
        self.chains, self.values = (
            np.concatenate(part, axis=1) for part in zip(*before, found, strict=True)
        )

    def go_on(self, verdict: Verdict, affordable: int) -> None:
        """Decide how, where the `verdict` is that the chains are not enough.

        Where they mix badly, the proposal is fitted again to the draws at hand, and these are
        thrown away: what is kept comes from one frozen proposal.  Where that does not help, only
        every so many steps are kept: neighbours say the same.

        Parameters
        ----------
        verdict : Verdict
        affordable : int
            Steps to be kept for which there are evaluations left.
        """
        steps, every, few = self.steps, self.every, _MIXED * self.values.size
        slow = verdict.diagnostics.ess < few
        refits = 4
        can = self.ensembles.refittable
        if slow and can and self.refits < refits and 2 * every * steps <= affordable * every:
            self.ensembles = refitted(self.ensembles, self.chains, self.values, self.rng)
            self.chains, self.values = np.empty(0), np.empty(0)
            self.more, self.every, self.refits = 2 * every * steps, 1, self.refits + 1
            return
        if np.median(verdict.diagnostics.fewest) < few and steps > _FIRST_STEPS:
            self.chains, self.values = self.chains[:, 1::2], self.values[:, 1::2]
            self.every = 2 * every
        margin = 1.1  # a forecast of the steps that are needed, and a little further
        growth = margin / max(verdict.share, 1e-3)
        least_growth, most_growth = 1.3, 4.0
        growth = float(np.clip(growth, least_growth, most_growth))
        self.more = max(min(int((growth - 1) * self.steps), affordable), 1)

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """All of it but the density, for a checkpoint."""
        numbers = {
            "share": self.ensembles.share,
            **{name: getattr(self, name) for name in ("more", "every", "refits")},
            "rng": self.rng.bit_generator.state,
        }
        kind, words, *others = self.ensembles.state
        numbers["state"] = [kind, np.asarray(words).tolist(), *others]
        return {
            **self.ensembles.proposal.to_arrays(),
            "positions": self.ensembles.positions,
            "chains": self.chains,
            "values": self.values,
            "numbers": np.array(json.dumps(numbers)),
        }

    @classmethod
    def from_arrays(
        cls, arrays: Mapping[str, NDArray[Any]], density: LogDensity, redraw: Redraw | None
    ) -> Run:
        """What `to_arrays` kept, of the same `density` and `redraw`."""
        numbers = json.loads(str(arrays["numbers"]))
        kind, words, *others = numbers["state"]
        rng = np.random.default_rng()
        rng.bit_generator.state = numbers["rng"]
        return cls(
            Ensembles(
                density,
                restored(arrays),
                numbers["share"],
                arrays["positions"],
                (kind, np.array(words, dtype=np.uint32), *others),
                redraw,
            ),
            rng,
            arrays["chains"],
            arrays["values"],
            *(numbers[name] for name in ("more", "every", "refits")),
        )


def run_until_done(
    run: Run,
    rule: Rule,
    left: Callable[[float], int],
    report: Progress,
    keep: Callable[[Run], None],
) -> Verdict:
    """Advance all ensembles until they are done, or no evaluations are `left`.

    Chains that lack little by then go on for as many evaluations again: what was spent on them
    would be lost, and with it the limit, for want of a few steps.

    Parameters
    ----------
    run : Run
        One with chains is looked at first.
    rule : callable
        Judges chains in sampling coordinates.
    left : callable
        Evaluations that may still be spent, where so many times the usual may be in all.
    report : callable
    keep : callable
        Called with the run before its chains are looked at.
    """

    def advance() -> None:
        steps = run.steps + run.more
        report(0.25 + 0.74 * run.steps / steps, f"step {run.every * steps}")
        run.advance()
        keep(run)

    if not run.steps:
        advance()
    while True:
        verdict = rule(run.chains)
        nearly = not verdict.known and verdict.share >= _NEARLY
        affordable = left(1 / _NEARLY if nearly else 1.0) // (ENSEMBLES * WALKERS * run.every)
        if verdict.done or affordable < _FIRST_STEPS:
            return verdict
        run.go_on(verdict, affordable)
        advance()
