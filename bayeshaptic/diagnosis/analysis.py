"""The analysis of one measurement: everything that one report shows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from bayeshaptic.devices import Device
from bayeshaptic.diagnosis.feedback.in_loop import InLoop
from bayeshaptic.diagnosis.hidden.hidden import Hidden
from bayeshaptic.diagnosis.residuals.moved import moved_besides
from bayeshaptic.errors import Notice
from bayeshaptic.inference.choose import Choice
from bayeshaptic.inference.fit import Fit
from bayeshaptic.inference.posterior import Posterior
from bayeshaptic.models import Model
from bayeshaptic.quantities import quantity
from bayeshaptic.recordings.checks.sufficiency import told_too_little
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.shown import Shown
from bayeshaptic.stability.critical import CriticalStiffness
from bayeshaptic.stability.from_etfe import EtfeCriticalStiffness


@dataclass(frozen=True, eq=False, repr=False)
class Analysis(Shown):
    """What is known of one device from one measurement.

    Attributes
    ----------
    recording : Recording or None
        None for a table of a frequency response.
    etfe : Etfe
    device : Device or None
    model : Model
        The fitted model, with the priors that were used.
    choice : Choice or None
        Why this base model; None where it was asked for.
    fit : Fit
    posterior : Posterior
    limit : CriticalStiffness
    etfe_limit : EtfeCriticalStiffness
        Read from the measured response without a model.
    notices : tuple of Notice
    seconds : mapping
        Stage to the time it took.
    noise_scale : float
        Factor on the noise variance in the posterior where the model misfits
        (`bayeshaptic.diagnosis.residuals.overdispersion`), 1 elsewhere.
    lever_m : float or None
    hidden : Hidden or None
        What could hide, where the limit allows for it.
    in_loop : InLoop or None
        The motion that posterior and limit come from, where feedback biases the response or a
        force in open loop says too little of it; no limit is stated then.
    sampled : bool
        False where feedback makes the response worthless: `posterior` is then normal draws around
        the fit, for a picture, and no limit is stated.
    widened : Posterior or None
        The posterior with the error of a force that was taken off, and with what is unexplained;
        None where there is neither.
    """

    recording: Recording | None
    etfe: Etfe
    device: Device | None
    model: Model
    choice: Choice | None
    fit: Fit
    posterior: Posterior
    limit: CriticalStiffness
    etfe_limit: EtfeCriticalStiffness
    notices: tuple[Notice, ...]
    seconds: Mapping[str, float]
    noise_scale: float = 1.0
    lever_m: float | None = None
    in_loop: InLoop | None = None
    hidden: Hidden | None = None
    sampled: bool = True
    widened: Posterior | None = None

    @property
    def stated(self) -> Posterior:
        """The posterior whose intervals are told; `posterior` takes every fitted force as exact."""
        return self.posterior if self.widened is None else self.widened

    @property
    def declared(self) -> CriticalStiffness:
        """The limit if the model is exact, with what was found; `limit` allows for more."""
        return self.limit if self.hidden is None else self.hidden.declared

    @cached_property
    def moved_besides(self) -> float:
        """See `bayeshaptic.diagnosis.residuals.moved`; kept: every headline of a page asks."""
        assert self.etfe.unbroken is not None
        return moved_besides(self.fit, self.etfe.unbroken)

    # What a report asks of any result, closed loop or not: see `bayeshaptic.diagnosis.result`.
    @property
    def analysis(self) -> Analysis:
        return self

    @property
    def measured(self) -> Analysis:
        return self

    @property
    def closed(self) -> None:
        return None

    @property
    def effect_names(self) -> tuple[str, ...]:
        return ()

    def _lines(self) -> tuple[str, ...]:
        of = "a frequency response" if self.recording is None else self.recording.name
        state = "converged" if self.posterior.converged else "not converged"
        return (
            f"Analysis of {of} with the model {self.model.name}",
            limit_line(self),
            f"reduced chi-square {quantity(self.fit.reduced_chi_square, '')}, sampler {state}, "
            f"{sum(n.level == 'warning' for n in self.notices)} warnings",
        )


def limit_line(analysis: Analysis) -> str:
    """The limit in a line, or why there is none."""
    told = told_too_little(analysis.notices)
    return repr(analysis.limit).partition("\n")[0] if told is None else f"No limit: {told.reason}"
