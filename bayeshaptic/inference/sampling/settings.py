"""What a sampler is asked for, whatever the posterior is of."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from bayeshaptic.inference.sampling.stopping import Rule
from bayeshaptic.types import Progress

MOST_EVALUATIONS = 1_500_000


@dataclass(frozen=True)
class SamplerSettings:
    """What a sampler is asked for.

    Attributes
    ----------
    rule : callable
        When to stop: judges chains of natural values, as `bayeshaptic.inference.sampling.stopping`
        says.  It may look at more than the parameters, the limit say.
    seed : int
        Same seed, same draws.
    progress : callable, bool or None
        Called with the share done and a word about it; True draws a bar.
    checkpoints : path or None
        Folder in which a sampler that runs for long keeps its state, to go on after an
        interruption.
    most_evaluations : int
        Evaluations of the likelihood after which to give up, the same on every machine; twice as
        many where little is lacking.
    """

    rule: Rule
    seed: int = 0
    progress: Progress | bool | None = None
    checkpoints: str | Path | None = None
    most_evaluations: int = MOST_EVALUATIONS
