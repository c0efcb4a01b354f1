r"""The motion of one mass in a loop, fitted to a recording with feedback.

A mass with viscous and dry friction, a constant force and a delay is driven by the recorded command
*and* by a follower of the measured position.  Where the follower is the controller that was in the
loop, this is the closed-loop output error (A. Janot, P.-O. Vandanjon and M. Gautier, "A generic
instrumental variable approach for industrial robot identification", IEEE Transactions on Control
Systems Technology 22, 2014): what enters the model holds no noise, so that feedback biases nothing,
and no reference is needed.  Another follower costs an error of second order in the remaining force;
a second one, with a lower bandwidth, shows how large it is, and widens the result by what their
noise does not explain.

Errors have equal weights on purpose.  Weights by the residual's own spectrum hand friction over to
the noise where the remaining force depends on position and direction: such a force is in the model.
Where a white force is all that remains, `white_force` weighs them better.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from bayeshaptic.inference.time_domain.descent import Descended, descend
from bayeshaptic.inference.time_domain.follower import Follower, bandwidth_hz
from bayeshaptic.inference.time_domain.innovations.filter import Disturbance
from bayeshaptic.inference.time_domain.mass_forces import COULOMB, MassForces
from bayeshaptic.inference.time_domain.mass_in_loop import SHARED, Hum, MassInLoop
from bayeshaptic.inference.time_domain.start import by_inverse_dynamics
from bayeshaptic.inference.time_domain.uneven import WAVES, Way
from bayeshaptic.inference.time_domain.widths.of_values import covariance_of_shared
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.types import Floats


@dataclass(frozen=True)
class MotionFit:
    """One mass in a loop, fitted.

    Attributes
    ----------
    values : ndarray, shape (5,)
        `NAMES`: mass, viscous damping, dry friction, constant force (positive against a positive
        command), delay in s.  Not held above zero: where the data put a parameter below, its
        part above is what the posterior keeps.
    covariance : ndarray, shape (5, 5)
    bandwidth_hz : float
        Of the follower, or of the command where the feedback was declared.
    error_rms : float
        Of the position, measured less simulated.
    uneven_rms : float
        Of the force that changes along the way.
    converged : bool
    simulated : ndarray, shape (N,)
        The position in the simulated loop.
    uneven : ndarray, shape (2 WAVES,)
        The force that changes along the way: its waves forward and backward.
    way : Way
    follower : Follower
    whole : ndarray
        All values of the `MassInLoop`, as they are best where they are possible.
    forces : MassForces
        Dry friction's law, and further ones.
    whole_sd : ndarray
        Of all values.
    hums : tuple of Hum
        In the first piece.
    disturbed : Disturbance or None
        What values and covariance allow for, where that is white; None with equal weights.
    """

    values: Floats
    covariance: Floats
    bandwidth_hz: float
    error_rms: float
    uneven_rms: float
    converged: bool
    simulated: Floats = field(repr=False)
    uneven: Floats = field(repr=False)
    way: Way
    follower: Follower
    whole: Floats = field(repr=False)
    forces: MassForces
    whole_sd: Floats
    hums: tuple[Hum, ...] = ()
    disturbed: Disturbance | None = None

    @property
    def inside(self) -> Floats:
        """The best values that are possible, shape (5,)."""
        return self.whole[:SHARED]

    @property
    def numbers(self) -> Floats:
        """Of the laws, one for each of `forces.names`."""
        return self.whole[len(self.whole) - len(self.forces.names) :]

    @property
    def number_sd(self) -> Floats:
        """Of `numbers`."""
        return self.whole_sd[len(self.whole) - len(self.forces.names) :]

    def velocity(self, recording: Recording) -> Floats:
        """Of the simulated motion in the recording that was fitted, shape (N,)."""
        pieces = replace(recording, position=self.simulated).pieces
        return np.concatenate([np.gradient(one.position, one.period_s) for one in pieces])

    def loop(self, recording: Recording, later_s: float = 0.0) -> MassInLoop:
        """The loop that was followed, or that of another recording, begun so much later."""
        hums = tuple(hum.later(later_s) for hum in self.hums)
        loop = MassInLoop.of(recording, self.bandwidth_hz, self.way, self.forces, hums)
        return replace(loop, follower=self.follower)

    @property
    def sd(self) -> Floats:
        return np.sqrt(np.diag(self.covariance))

    def error_on(self, recording: Recording, later_s: float = 0.0) -> Floats:
        """Measured less simulated position of another recording, with these values; (N,).

        Where its pieces begin, and hums, are fitted to it.  It begins `later_s` after the fitted.
        """
        loop = self.loop(recording, later_s)
        begun = loop.begun(self.inside, self.numbers)
        return loop.error(loop.with_beginnings(begun, self.uneven), self.uneven)


def fit_motion(
    recording: Recording,
    feedback: Follower | None = None,
    forces: MassForces = COULOMB,
    start: Floats | None = None,
    hums: tuple[Hum, ...] = (),
) -> MotionFit:
    """Fit one mass with friction to a recording made in closed loop.

    Parameters
    ----------
    recording : Recording
    feedback : Follower, optional
        The controller's feedback of the position, as a force for measured - simulated.  Unknown by
        default: a spring and a damper as wide as the command's spectrum stand for it.
    forces : MassForces
        Laws of forces on the mass, whose numbers are inferred; Coulomb's friction by default.
    start : ndarray, shape (5,), optional
        Values to begin with; by default those of the inverse dynamics.
    hums : tuple of Hum
        Forces on the mass whose size and phase are inferred.

    Returns
    -------
    MotionFit

    Raises
    ------
    InputError
        Where no motion of one mass can be found beside the measured one.
    """
    width = bandwidth_hz(recording.force, recording.period_s)
    way = Way.of(recording.position)
    loop = MassInLoop.of(recording, width, way, forces, hums)
    begun = loop.begun(by_inverse_dynamics(recording) if start is None else start)
    loop = loop.led(feedback, begun)
    first = descend(loop, begun)
    other = 0.4  # bandwidth of the second follower over that of the first
    second = descend(loop.led(None, begun, other), first.inside)
    apart = _beyond_noise(first, second)
    spread = first.covariance + np.outer(apart, apart)
    assert loop.follower is not None
    return MotionFit(
        values=first.values[:SHARED],
        covariance=covariance_of_shared(spread, first.found),
        bandwidth_hz=width,
        error_rms=float(np.sqrt(np.mean(first.error**2))),
        uneven_rms=float(np.sqrt(np.mean((first.uneven.reshape(2, WAVES) @ loop.shapes) ** 2))),
        converged=first.converged and second.converged,
        simulated=loop.position - first.error,
        uneven=first.uneven,
        way=way,
        follower=loop.follower,
        whole=first.inside,
        forces=forces,
        whole_sd=np.sqrt(np.diag(spread)),
        hums=loop.hums_at(first.inside),
    )


def _beyond_noise(first: Descended, second: Descended) -> Floats:
    """How far two fits lie apart, less what they would by chance, shape (V,).

    The difference of an estimate and a better one has the difference of their variances (J. A.
    Hausman, Econometrica 46, 1978).  Of `NAMES` alone, of which simulated loops show that intervals
    hold: where nothing but counts is left a drag is no better known than both fits agree.
    """
    apart = second.values - first.values
    chance = np.diag(second.covariance) - np.diag(first.covariance)
    chance[SHARED:] = 0.0
    beyond = np.maximum(apart**2 - np.maximum(chance, 0.0), 0.0)
    return np.asarray(np.copysign(np.sqrt(beyond), apart))
