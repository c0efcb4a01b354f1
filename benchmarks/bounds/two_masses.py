"""The least width that K_CR of a free device allows whose encoder alone disturbs: Cramer and Rao.

Whatever the controller, the innovations of such a loop are the noise of the encoder.  The motion is
simulated in time from the recorded force, from a state that nobody knows.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import expm

from bayeshaptic.models import Model
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.rig import Bench
from bayeshaptic.stability.critical import critical_stiffness
from bayeshaptic.types import Floats

_STEP = 1e-4  # of a parameter, or of all dampers where a damper is zero


def bound_db(recording: Recording, bench: Bench, model: Model) -> float:
    """Least standard deviation of K_CR in dB, all parameters of the model and its state unknown.

    Parameters
    ----------
    recording : Recording
    bench : Bench
        Of two masses that nobody holds, without friction.
    model : Model
        `free`, for the names and the limit.
    """
    truth = np.array([bench.values.get(name, bench.delay_s) for name in model.names])
    dampers = sum(bench.values[name] for name in ("b1", "b2"))
    size = np.where(truth > 0, truth, dampers)
    up = truth + _STEP * np.diag(size)
    down = np.maximum(truth - _STEP * np.diag(size), 0.0)
    span = np.diag(up - down)
    both = np.concatenate([up, down])
    told = {"delay_s": bench.delay_s}  # where it is no parameter
    values = [told | dict(zip(model.names, row, strict=True)) for row in both]
    starts = np.concatenate([np.zeros((len(both), 4)), np.eye(4)])
    force = np.ones(len(starts))
    force[len(both) :] = 0.0
    here = told | dict(zip(model.names, truth, strict=True))
    moved = _motions([*values, *[here] * 4], recording, starts, force)
    count = len(truth)
    slope = ((moved[:, :count] - moved[:, count : 2 * count]) / span) * size
    own = np.linalg.qr(moved[:, 2 * count :] / np.linalg.norm(moved[:, 2 * count :], axis=0))[0]
    slope = slope - own @ (own.T @ slope)
    power = bench.encoder_resolution**2 / 12 + bench.sensor_noise_rms**2
    information = slope.T @ slope / power
    limits = 20 * np.log10(critical_stiffness(model, both).samples)
    gradient = (limits[:count] - limits[count:]) / span * size
    covariance = np.linalg.pinv(information, rcond=1e-14, hermitian=True)
    return float(np.sqrt(gradient @ covariance @ gradient))


def _motions(
    devices: list[dict[str, float]], recording: Recording, starts: Floats, force: Floats
) -> Floats:
    """Positions at the samples, (N, M), of devices that each get a multiple of the force."""
    period_s, samples = recording.period_s, recording.samples
    free, past, now, turns = zip(*(_step(one, period_s) for one in devices), strict=True)
    delayed = np.concatenate([np.zeros(max(turns) + 1), recording.force])
    begin = max(turns) - np.array(turns)  # where the past command of the first sample is
    state, forward = starts.copy(), np.array(free)
    push = np.array(past) * force[:, None], np.array(now) * force[:, None]
    out = np.empty((samples, len(devices)))
    for sample in range(samples):
        out[sample] = state[:, 0]
        before, after = delayed[begin + sample], delayed[begin + sample + 1]
        state = np.einsum("mij,mj->mi", forward, state)
        state += push[0] * before[:, None] + push[1] * after[:, None]
    return out


def _step(values: dict[str, float], period_s: float) -> tuple[Floats, Floats, Floats, int]:
    """Over a period: of the state, the command before and this one; whole periods of delay."""
    m1, b1, bc, kc, m2, b2 = (values[name] for name in ("m1", "b1", "bc", "kc", "m2", "b2"))
    motion = np.array(
        [
            [0, 1, 0, 0],
            [-kc / m1, -(b1 + bc) / m1, kc / m1, bc / m1],
            [0, 0, 0, 1],
            [kc / m2, bc / m2, -kc / m2, -(b2 + bc) / m2],
        ]
    )

    def held(seconds: float) -> tuple[Floats, Floats]:
        whole = np.zeros((5, 5))
        whole[:4, :4], whole[1, 4] = motion * seconds, seconds / m1
        grown = np.asarray(expm(whole))
        return grown[:4, :4], grown[:4, 4]

    turns = int(values["delay_s"] // period_s)
    late = values["delay_s"] - turns * period_s
    (rest, now), (_, early) = held(period_s - late), held(late)
    return held(period_s)[0], rest @ early, now, turns
