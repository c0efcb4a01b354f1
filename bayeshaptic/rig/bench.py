"""The bench: a device, perhaps in a hand, with its loop, its encoder and the effects it has."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from bayeshaptic.devices import Device, load_device
from bayeshaptic.errors import InputError
from bayeshaptic.rig.dynamics.plant import Plant, assemble
from bayeshaptic.rig.dynamics.structure import chain, check_parameters
from bayeshaptic.rig.effects import Effect, MotionScales, make_effect
from bayeshaptic.rig.scales import motion_scales
from bayeshaptic.rig.truth import critical_limit

POSITION_UNITS = {"N": "m", "Nm": "rad"}


@dataclass(frozen=True)
class Defaults:
    """Usual sizes for a kind of device.

    Attributes
    ----------
    force_unit : {"N", "Nm"}
    force_rms, tremor_rms, wander_rms : float
        Of the excitation, and of the two forces of a hand, in that unit.
    encoder_resolution : float
        One count, m or rad.
    """

    force_unit: str
    force_rms: float
    tremor_rms: float
    wander_rms: float
    encoder_resolution: float


# Tremor of 0.2 N moves the held LHIfAM by some 10 um, 5 mN m the held PHANToM by 0.25 mrad (0.03 mm
# at its tip); wander of 0.5 N and 8 mN m moves them by 4 mm and 6 mrad.
DEFAULTS = {
    "translational": Defaults("N", 4.0, 0.2, 0.5, 1e-6),
    "rotational": Defaults("Nm", 0.1, 5e-3, 8e-3, 2 * np.pi / 16000),
}

MOST_PERIODS = 100  # of the loop's delay, each of which is a state more


@dataclass(frozen=True)
class Bench:
    """A device on the bench. What is 0 is absent; `quiet` takes away all noise at once.

    Attributes
    ----------
    mechanism : {"rigid", "free", "grasped"}
    values : mapping of str to float
        Masses, dampers and springs by the paper's names, SI units.
    period_s, delay_s : float
        Sampling period and loop delay; the delay may be any number of periods and a fraction.
    force_unit : {"N", "Nm"}
    encoder_resolution : float
        One count, m or rad. Positions are rounded to the nearest count.
    sensor_noise_rms : float
        White noise on the position, before it is rounded.
    tremor_rms, tremor_hz : float, tuple of float
        Force of the hand's tremor on the hand's mass, and its band. Without a hand there is none.
    wander_rms, wander_hz : float
        Force of the hand's voluntary movement: flat up to `wander_hz`, steep above.
    force_rms, band_hz : float, tuple of float
        Usual excitation, and its lowest and highest frequency.
    effects : tuple of Effect
        What the bench has beyond the plain chain.
    device, user : str or None
        Names, for the description.
    """

    mechanism: str
    values: Mapping[str, float]
    period_s: float = 1e-3
    delay_s: float = 0.0
    force_unit: str = "N"
    encoder_resolution: float = 0.0
    sensor_noise_rms: float = 0.0
    tremor_rms: float = 0.0
    tremor_hz: tuple[float, float] = (8.0, 12.0)
    wander_rms: float = 0.0
    wander_hz: float = 0.3
    force_rms: float = 1.0
    band_hz: tuple[float, float] = (0.5, 300.0)
    effects: tuple[Effect, ...] = ()
    device: str | None = None
    user: str | None = None

    def __post_init__(self) -> None:
        check_parameters(self.mechanism, self.values)
        for name, value in self.values.items():
            if name.startswith("m") and not value > 0:
                raise InputError(f"the mass {name} is {value:g}; give a mass above zero")
        if self.force_unit not in POSITION_UNITS:
            raise InputError(f"the bench has forces in N or Nm, not '{self.force_unit}'")
        if not self.period_s > 0 or not self.delay_s >= 0:
            raise InputError(
                f"a period of {self.period_s:g} s and a delay of {self.delay_s:g} s cannot be; "
                "give a period above zero and a delay of at least zero"
            )

    @classmethod
    def from_device(
        cls,
        device: str | Path | Device,
        held: bool = False,
        mechanism: str | None = None,
        **changes: Any,
    ) -> Bench:
        """A bench with a device file's parameters and realistic noise.

        Parameters
        ----------
        device : str, Path or Device
            Name or device file.
        held : bool
            Whether somebody holds it: the grasped mechanism, tremor and wander.
        mechanism : {"rigid", "free", "grasped"}, optional
            Instead of what `held` says.
        **changes
            Fields of the bench that are to be different.

        Returns
        -------
        Bench

        Raises
        ------
        InputError
            Where the device file lacks the mechanism's parameters.
        """
        found = load_device(device)
        kind = mechanism or ("grasped" if held else "free")
        if kind not in found.parameters:
            known = ", ".join(found.parameters) or "none"
            raise InputError(
                f"device {found.name} has no parameters for a {kind} bench; it has {known}"
            )
        usual = DEFAULTS[found.kind]
        hand = kind == "grasped"
        period_s = found.period_s or 1e-3
        bench = cls(
            mechanism=kind,
            values=dict(found.parameters[kind]),
            period_s=period_s,
            delay_s=found.delay_s or 0.0,
            force_unit=usual.force_unit,
            encoder_resolution=found.encoder_resolution or usual.encoder_resolution,
            tremor_rms=usual.tremor_rms if hand else 0.0,
            wander_rms=usual.wander_rms if hand else 0.0,
            force_rms=usual.force_rms,
            band_hz=found.band_hz or (0.5, 0.3 / period_s),
            device=found.name,
            user="A" if hand else None,
        )
        return replace(bench, **changes)

    @property
    def position_unit(self) -> str:
        """m or rad, as goes with the force's unit."""
        return POSITION_UNITS[self.force_unit]

    @property
    def resolution(self) -> float:
        """The count that positions are rounded to, m or rad, effects included."""
        resolution = self.encoder_resolution
        for effect in self.effects:
            resolution = effect.resolution(resolution)
        return resolution

    @property
    def varies(self) -> bool:
        """Whether the mechanism changes during a recording."""
        return any(effect.varies for effect in self.effects)

    def with_effect(self, effect: str | Effect, **changes: Any) -> Bench:
        """A bench with one more effect, by name at its typical strength, or as given.

        Parameters
        ----------
        effect : str or Effect
        **changes
            Fields of a named effect that are to be different from the typical.

        Raises
        ------
        InputError
            For an unknown effect or field, and where the bench cannot have the effect.
        """
        if not isinstance(effect, Effect):
            effect = make_effect(effect, self.scales(), **changes)
        elif changes:
            effect = replace(effect, **changes)
        bench = replace(self, effects=(*self.effects, effect))
        bench.plant()
        return bench

    def quiet(self) -> Bench:
        """The same bench with a perfect encoder, and a hand that keeps still."""
        return replace(
            self, encoder_resolution=0.0, sensor_noise_rms=0.0, tremor_rms=0.0, wander_rms=0.0
        )

    def plant(self, progress: float = 0.0) -> Plant:
        """State equations when a part `progress` (0..1) of the recording is over.

        Raises
        ------
        InputError
            For a loop delay of more than 100 sampling periods.
        """
        values = self.values
        for effect in self.effects:
            values = effect.parameters(values, progress)
        structure = chain(self.mechanism, values, self.delay_s)
        for effect in self.effects:
            effect.build(structure)
        plant = assemble(structure)
        if plant.delay_s > MOST_PERIODS * self.period_s:
            raise InputError(
                f"a loop delay of {plant.delay_s:g} s is over {MOST_PERIODS} sampling periods of "
                f"{self.period_s:g} s; it is in seconds: 0.2 ms are 2e-4"
            )
        return plant

    def scales(self) -> MotionScales:
        """How far and how fast the bench moves under its usual excitation, without effects."""
        return motion_scales(replace(self, effects=()))

    def true_critical_stiffness(self, damping: float = 0.0) -> float:
        """The stiffness at which a virtual wall with that damping B loses stability.

        In N/m with B in N s/m, or N m/rad with B in N m s/rad; see `critical_limit`.
        """
        return critical_limit(self, damping).stiffness
