"""A recording: commanded force and measured position, sampled every T seconds."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.devices.device import kind_of
from bayeshaptic.errors import Notice
from bayeshaptic.quantities import pretty_unit, quantity
from bayeshaptic.recordings.feedback import Feedback
from bayeshaptic.recordings.sensed import Sensed
from bayeshaptic.shown import Shown

FORCE_UNITS = ("N", "Nm", "A")
POSITION_UNITS = ("m", "rad")


def stiffness_unit_of(force_unit: str, position_unit: str) -> str:
    """The unit of a force over a position: "N/m", "N m/rad", "A/m" or "A/rad"."""
    return f"{'N m' if force_unit == 'Nm' else force_unit}/{position_unit}"


@dataclass(frozen=True, eq=False, repr=False)
class Recording(Shown):
    """One experiment: commanded force u[k] and motor position y[k], every T seconds.

    The force u[k] is commanded at the instant of sample k and held until k + 1 (zero-order hold);
    the position y[k] is read at that same instant, so the earliest answer to u[k] is y[k + 1].

    Attributes
    ----------
    force : ndarray, shape (N,)
        Commanded force, in `force_unit`.
    position : ndarray, shape (N,)
        Measured motor position, in `position_unit`.
    period_s : float
        Sampling period T in seconds.
    force_unit : {"N", "Nm", "A"}
        "A" where no force constant is known; stiffness is then in A/m or A/rad.
    position_unit : {"m", "rad"}
    name : str
        What to call it in reports (the file's name by default).
    device, user : str or None
        Nobody holds the device where `user` is None.
    configuration : float or str or None
        A coordinate, or a name.
    trial : int or str or None
    level : float or None
        Excitation level as declared.
    encoder_resolution : float or None
        One encoder count, in `position_unit`, where it is known.
    time_jitter : float or None
        Standard deviation of the recorded time steps over the period; None without time stamps.
    source : Path or None
        The file it was read from.
    notices : tuple of Notice
        What was found and assumed when it was read.
    feedback : Feedback or None
        The controller that was in the loop, where somebody said which.
    joints : tuple of int
        Samples at which a further piece begins, where several recordings are joined
        (`bayeshaptic.join_recordings`); nothing is known of the time between them.
    joined : tuple of str
        The names of its pieces, where several recordings are joined.
    reference : ndarray, shape (N,), or None
        What the controller followed, in any unit, where it was written down: it moves the force,
        and nothing of the motion moves it.
    sensed : Sensed or None
        What was sensed, where it was not a command and a position.
    """

    force: NDArray[np.float64] = field(repr=False)
    position: NDArray[np.float64] = field(repr=False)
    period_s: float
    force_unit: str = "N"
    position_unit: str = "m"
    name: str = "recording"
    device: str | None = None
    user: str | None = None
    configuration: float | str | None = None
    trial: int | str | None = None
    level: float | None = None
    encoder_resolution: float | None = None
    time_jitter: float | None = None
    source: Path | None = None
    notices: tuple[Notice, ...] = ()
    feedback: Feedback | None = None
    joints: tuple[int, ...] = ()
    joined: tuple[str, ...] = ()
    reference: NDArray[np.float64] | None = field(default=None, repr=False)
    sensed: Sensed | None = None

    @property
    def kind(self) -> str:
        """ "translational" or "rotational", by the unit of the position."""
        return kind_of(self.position_unit)

    @property
    def samples(self) -> int:
        return len(self.force)

    @property
    def duration_s(self) -> float:
        return self.samples * self.period_s

    @property
    def stiffness_unit(self) -> str:
        return stiffness_unit_of(self.force_unit, self.position_unit)

    @property
    def pieces(self) -> tuple[Recording, ...]:
        """Its pieces, each a recording of its own name; itself where it is one."""
        if not self.joints:
            return (self,)
        spans = self.spans
        known = self.joined if len(set(self.joined)) == len(spans) else ()
        names = known or tuple(f"{self.name}, piece {n}" for n in range(1, len(spans) + 1))
        return tuple(
            replace(self.part(span.start, span.stop), name=name, joined=())
            for span, name in zip(spans, names, strict=True)
        )

    @property
    def spans(self) -> tuple[slice, ...]:
        """The samples of its pieces."""
        edges = (0, *self.joints, self.samples)
        return tuple(slice(a, b) for a, b in zip(edges[:-1], edges[1:], strict=True))

    def part(self, start: int, stop: int) -> Recording:
        """The samples from `start` up to but without `stop`, as a recording of its own."""
        joints = tuple(joint - start for joint in self.joints if start < joint < stop)
        force, position = self.force[start:stop], self.position[start:stop]
        reference = None if self.reference is None else self.reference[start:stop]
        sensed = None if self.sensed is None else self.sensed.part(start, stop)
        return replace(
            self,
            force=force,
            position=position,
            joints=joints,
            reference=reference,
            sensed=sensed,
        )

    def _lines(self) -> tuple[str, ...]:
        length = quantity(self.duration_s, "s")
        count = self.encoder_resolution
        encoder = "unknown" if count is None else quantity(count, self.position_unit)
        return (
            f"Recording {self.name}: {self.samples:,} samples in {length}, one every "
            f"{quantity(self.period_s, 's')}",
            f"force in {pretty_unit(self.force_unit)}, position in {self.position_unit}, encoder "
            f"count {encoder}",
            f"device {self.device or 'not named'}, held by {self.user or 'nobody named'}",
        )
