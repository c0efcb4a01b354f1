"""A model: a base structure, its parameters with priors, the loop delay, and its effects."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from bayeshaptic.arguments import at_the_door
from bayeshaptic.errors import InputError
from bayeshaptic.models.joint_prior import JointPrior, joint_prior
from bayeshaptic.models.parameter import Parameter, before_delay, unit_of
from bayeshaptic.models.prior import Prior
from bayeshaptic.models.response.system import Complexes, Floats, LinearSystem
from bayeshaptic.models.structures import Structure
from bayeshaptic.quantities import pretty_unit, quantity
from bayeshaptic.shown import Shown, listed

if TYPE_CHECKING:
    from bayeshaptic.devices import Device


class Extension(Protocol):
    """What extends a model, as the model sees it: parameters, and what they do to the system."""

    @property
    def name(self) -> str: ...

    @property
    def parameters(self) -> tuple[Parameter, ...]: ...

    def apply(self, system: LinearSystem, values: Mapping[str, Floats]) -> LinearSystem: ...


@dataclass(frozen=True, repr=False)
class Model(Shown):
    """A parametric model of the sampled response from commanded force to motor position.

    Attributes
    ----------
    structure : Structure
        Rigid, free or grasped.
    parameters : tuple of Parameter
        What is inferred, in this order; the delay last, unless it is known.
    fixed : mapping
        Parameters that are known: name to value.
    period_s : float or None
        Sampling period; None until data say it.
    reference : mapping
        The device file's own values; empty without one.
    force_unit, position_unit : str
    device : Device or None
    effects : tuple of Extension
    """

    structure: Structure
    parameters: tuple[Parameter, ...]
    fixed: Mapping[str, float] = field(default_factory=dict, hash=False)
    period_s: float | None = None
    reference: Mapping[str, float] = field(default_factory=dict, hash=False)
    force_unit: str = "N"
    position_unit: str = "m"
    device: Device | None = None
    effects: tuple[Extension, ...] = ()

    @property
    def name(self) -> str:
        return self.structure.name

    @property
    def held(self) -> bool:
        """Whether somebody holds the device."""
        return self.structure.held

    @cached_property
    def names(self) -> tuple[str, ...]:
        return tuple(parameter.name for parameter in self.parameters)

    @property
    def size(self) -> int:
        return len(self.parameters)

    @property
    def stiffness_unit(self) -> str:
        return unit_of("stiffness", self.force_unit, self.position_unit)

    @property
    def has_priors(self) -> bool:
        """False while some priors are still to be set from the data."""
        return all(parameter.prior is not None for parameter in self.parameters)

    @property
    def values(self) -> Floats:
        """The device file's values of the parameters, shape (P,).

        Raises
        ------
        InputError
            Without a device file: there are no values before a fit.
        """
        missing = [name for name in self.names if name not in self.reference]
        if missing:
            raise InputError(
                f"the {self.name} model has no values for {', '.join(missing)}: name a device "
                '(device="lhifam"), or fit the model to a recording first.'
            )
        return np.array([self.reference[name] for name in self.names])

    def parameter(self, name: str) -> Parameter:
        """The sampled parameter called `name`; an InputError where there is none."""
        self._refuse_unknown((name,))
        return self.parameters[self.names.index(name)]

    def prior(self, name: str) -> Prior:
        """The prior of the parameter called `name`; an InputError where it is not set yet."""
        prior = self.parameter(name).prior
        if prior is None:
            raise InputError(f"the prior of {name} is not set: fit the model to data first.")
        return prior

    def unit(self, name: str) -> str:
        """Unit of the parameter called `name`, for example "N s/m"."""
        return unit_of(self.parameter(name).dimension, self.force_unit, self.position_unit)

    def system(self, theta: ArrayLike) -> LinearSystem:
        """The linear systems of parameter vectors `theta`, shape (B, P) or (P,)."""
        theta = np.atleast_2d(np.asarray(theta, float))
        if theta.shape[1] != self.size:
            raise InputError(
                f"the {self.name} model has {self.size} parameters ({', '.join(self.names)}), "
                f"but {theta.shape[1]} were given."
            )
        values: dict[str, Floats] = dict(zip(self.names, theta.T, strict=True))
        values |= {name: np.full(len(theta), value) for name, value in self.fixed.items()}
        system = LinearSystem(self.structure.build(values), values["delay_s"])
        for effect in self.effects:
            system = effect.apply(system, values)
        return system

    def measured_system(self, theta: ArrayLike) -> LinearSystem:
        """The same as a sensor of the force shows them, which may lag: the loop itself has none.

        Parameters
        ----------
        theta : array_like, shape (B, P) or (P,)
        """
        system = self.system(theta)
        if "force_lag_s" not in self.names:
            return system
        lag = np.atleast_2d(np.asarray(theta, float))[:, self.names.index("force_lag_s")]
        one = np.ones_like(lag)
        return system.with_filter(np.stack([one, lag]), one[None])

    @at_the_door
    def response(
        self,
        theta: ArrayLike,
        frequency_hz: ArrayLike,
        approximation: str = "exact",
        measured: bool = False,
    ) -> Complexes:
        """Sampled response from force to position.

        Parameters
        ----------
        theta : array_like, shape (B, P) or (P,)
            Parameters in the order of `names`, SI units.
        frequency_hz : array_like, shape (L,)
            The exact response repeats itself above the Nyquist frequency. At zero it is the
            compliance, infinite where no spring holds the device.
        approximation : {"exact", "continuous"}
            "continuous" is the paper's P(s) e^{-s (td + T/2)}.
        measured : bool
            As `measured_system` has it, which a fit is compared with.

        Returns
        -------
        ndarray of complex, shape (B, L) or (L,)
            In `position_unit` over `force_unit`.
        """
        if self.period_s is None:
            raise InputError("the model has no sampling period: give period_s, or a device.")
        system = self.measured_system(theta) if measured else self.system(theta)
        frequency_hz = np.atleast_1d(np.asarray(frequency_hz, float))
        if frequency_hz.ndim > 1:
            raise InputError(f"frequency_hz has the shape {frequency_hz.shape}; give one axis")
        if approximation not in ("exact", "continuous"):
            raise InputError(f'approximation is "exact" or "continuous", not {approximation!r}.')
        response = system.response(frequency_hz, self.period_s, approximation == "exact")
        return response[0] if np.ndim(theta) == 1 else response

    def to_control(self, theta: ArrayLike | None = None) -> Any:
        """The sampled response as a ``control.StateSpace`` of python-control, exact.

        Close the loop of a wall by ``control.feedback(model.to_control(theta), K)``.

        Parameters
        ----------
        theta : array_like, shape (P,), optional
            Parameters in the order of `names`; by default those of the device file.

        Raises
        ------
        InputError
            If python-control is not installed, the model has no sampling period, or no finite
            number of states.
        """
        from bayeshaptic.models.response.state_space import of_python_control

        if self.period_s is None:
            raise InputError("the model has no sampling period: give period_s, or a device.")
        system = self.system(self.values if theta is None else theta)
        return of_python_control(system, self.period_s)

    def log_prior(self, theta: ArrayLike) -> Floats:
        """Log prior density of parameter vectors `theta` of shape (B, P); shape (B,)."""
        return self._joint_prior(np.atleast_2d(np.asarray(theta, float)))

    @cached_property
    def _joint_prior(self) -> JointPrior:
        return joint_prior([self.prior(name) for name in self.names])

    @at_the_door
    def with_period(self, period_s: float) -> Model:
        """With the sampling period `period_s`, in seconds."""
        return replace(self, period_s=period_s)

    @at_the_door
    def with_prior(self, priors: Mapping[str, Prior]) -> Model:
        """With other priors for the named parameters.

        Raises
        ------
        InputError
            If a name is not a parameter of this model, or a prior allows for no value of it.
        """
        self._refuse_unknown(priors)
        parameters = tuple(replace(p, prior=priors.get(p.name, p.prior)) for p in self.parameters)
        return replace(self, parameters=parameters)

    def _refuse_unknown(self, names: Iterable[str]) -> None:
        unknown = sorted(set(names) - set(self.names))
        if unknown:
            raise InputError(
                f"no parameter {', '.join(map(str, unknown))} in the {self.name} model; it has "
                f"{', '.join(self.names)}."
            )

    @at_the_door
    def with_known(self, values: Mapping[str, float]) -> Model:
        """With some parameters known, no longer inferred.

        Parameters
        ----------
        values : mapping
            Name to value; names that are no parameter of the model are left aside.

        Raises
        ------
        InputError
            For a value that the parameter cannot have.
        """
        left = tuple(p for p in self.parameters if p.name not in values)
        known = {p.name: p.known(values[p.name]) for p in self.parameters if p.name in values}
        return replace(self, parameters=left, fixed={**self.fixed, **known})

    @at_the_door
    def with_effect(self, effect: Extension) -> Model:
        """With one more linear effect, whose parameters come before the delay's."""
        parameters = before_delay(self.parameters, effect.parameters)
        return replace(self, parameters=parameters, effects=(*self.effects, effect))

    def without_effect(self, effect: Extension) -> Model:
        """Without `effect`, one of its linear effects, and the parameters that came with it."""
        gone = {parameter.name for parameter in effect.parameters}
        return replace(
            self,
            parameters=tuple(p for p in self.parameters if p.name not in gone),
            effects=tuple(e for e in self.effects if e is not effect),
        )

    def _lines(self) -> tuple[str, ...]:
        names = [effect.name for effect in self.effects]
        added = f" with {', '.join(names)}" if names else ""
        period = "not set" if self.period_s is None else quantity(self.period_s, "s")
        delay = self.fixed.get("delay_s")
        known = "estimated" if delay is None else quantity(delay, "s")
        return (
            f"Model {self.name}{added}: {self.structure.title}",
            f"{self.size} parameters: {listed(self.names, 12)}",
            f"force in {pretty_unit(self.force_unit)}, position in {self.position_unit}; "
            f"period {period}, delay {known}",
        )
