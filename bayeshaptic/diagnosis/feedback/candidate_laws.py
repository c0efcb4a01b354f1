"""Laws that one mass may lack: other dry friction, and resistances over the velocity."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from bayeshaptic.diagnosis.feedback.smooth_motion import SmoothMotion, smooth_pieces
from bayeshaptic.effects.laws import corrections
from bayeshaptic.effects.nonlinear.drag import CubicDamping, Drag
from bayeshaptic.effects.nonlinear.friction import DahlFriction, RisingFriction, StribeckFriction
from bayeshaptic.effects.nonlinear.internal_force import MOTOR
from bayeshaptic.effects.nonlinear.shapes import Usual
from bayeshaptic.inference.time_domain.mass_forces import MassForces
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.types import Floats

# From what acts already, its dry friction and the strength asked for, to what acts with a law.
Joining = Callable[[MassForces, float, float], MassForces]

_SLOW = "stribeck_"  # before the share of the usual velocity, in the name of a shape


@dataclass(frozen=True)
class CandidateLaw:
    """A force to ask for.

    Attributes
    ----------
    name : str
    force : ndarray, shape (N,)
        Of strength one, as the measured motion says.
    joined : Joining
        What acts with it.
    """

    name: str
    force: Floats = field(repr=False)
    joined: Joining = field(repr=False)


def candidate_laws(
    recording: Recording, path: SmoothMotion, usual: Usual
) -> Iterator[CandidateLaw]:
    """Other laws of dry friction, and resistances that grow with a power of the velocity."""
    for shape in corrections(usual):
        part = float(shape.name.removeprefix(_SLOW)) * usual.velocity
        force = shape.force(path.velocity)
        yield CandidateLaw(StribeckFriction.name, force, _stribeck(StribeckFriction, part))
        yield CandidateLaw(RisingFriction.name, -force, _stribeck(RisingFriction, part))
    for share in (0.01, 0.03, 0.1):  # of the way, in which friction begins as a spring
        length = share * float(np.ptp(path.position))
        yield CandidateLaw(DahlFriction.name, _presliding(recording, length), _dahl(length))
    for kind in (Drag, CubicDamping):
        (shape, *_) = kind.shapes(MOTOR, usual)
        yield CandidateLaw(kind.name, shape.force(path.velocity), _beside(kind))


def _stribeck(kind: type[StribeckFriction] | type[RisingFriction], slow: float) -> Joining:
    """Coulomb's friction, more or less near standstill."""

    def joined(acting: MassForces, dry: float, strength: float) -> MassForces:
        share = strength / max(dry, strength)
        change, speed = kind.tuned
        law = kind(MOTOR, {change: min(share, 0.9 * kind.most.get(change, np.inf)), speed: slow})
        return replace(acting, friction=law)

    return joined


def _dahl(length: float) -> Joining:
    (distance,) = DahlFriction.tuned
    law = DahlFriction(MOTOR, {distance: length})
    return lambda acting, dry, strength: replace(acting, friction=law)


def _beside(
    kind: type[Drag] | type[CubicDamping],
) -> Joining:
    def joined(acting: MassForces, dry: float, strength: float) -> MassForces:
        others = (*acting.others, kind(MOTOR))
        return replace(acting, others=others, strengths=(*acting.strengths, strength))

    return joined


def _presliding(recording: Recording, length: float) -> Floats:
    """Dahl's friction of strength one, shape (N,)."""
    parts = []
    for piece in recording.pieces:
        held, found = 0.0, [0.0]
        for step in np.diff(smooth_pieces(piece).position).tolist():
            slides = math.copysign(1.0, step)
            held = slides + (held - slides) * math.exp(-abs(step) / length)
            found.append(-held)
        parts.append(found)
    return np.concatenate(parts)
