"""Slow, obvious references for the virtual bench: transfer functions, matrix exponentials."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

Complex = NDArray[np.complex128]
Transfer = Callable[[Complex], Complex]


def continuous(values: dict[str, float], **added: Transfer) -> Transfer:
    """Position of m1 over force, from the polynomials of Diaz and Gil (2010), or m s^2 + b s.

    `added` are dynamic stiffnesses from the ground to m1, m2 and hand.
    """
    at = {node: added.get(node, lambda s: 0.0 * s) for node in ("m1", "m2", "hand")}
    if "m" in values:
        return lambda s: 1 / (values["m"] * s**2 + values["b"] * s + at["m1"](s))
    p = {**dict.fromkeys(("bs", "ks", "bh", "kh"), 0.0), "mh": 1.0, **values}

    def response(s: Complex) -> Complex:
        qc, qs = p["bc"] * s + p["kc"], p["bs"] * s + p["ks"]
        q1 = p["m1"] * s**2 + p["b1"] * s + qc + at["m1"](s)
        q2 = p["m2"] * s**2 + p["b2"] * s + qc + qs + at["m2"](s)
        qh = p["mh"] * s**2 + p["bh"] * s + p["kh"] + qs + at["hand"](s)
        return (qh * q2 - qs**2) / (qh * q2 * q1 - qc**2 * qh - qs**2 * q1)

    return response


def sampled(
    response: Transfer, frequency_hz: NDArray[np.float64], period_s: float, delay_s: float
) -> Complex:
    """Hold, response and delay on the unit circle, as the sum over 2 x 1500 aliases."""
    w = 2 * np.pi * frequency_hz
    total = np.zeros(len(w), dtype=complex)
    for k in range(-1500, 1501):
        s = 1j * (w + 2 * np.pi * k / period_s)
        total += np.exp(-s * delay_s) * response(s) / s
    return (1 - np.exp(-1j * w * period_s)) / period_s * total


def states(values: dict[str, float]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """State matrix and input column, state (x, v), written out mass by mass."""
    if "m" in values:
        return np.array([[0, 1], [0, -values["b"] / values["m"]]]), np.array([0, 1 / values["m"]])
    v = {**dict.fromkeys(("bs", "ks", "bh", "kh"), 0.0), "mh": 1.0, **values}
    mass = np.diag([v["m1"], v["m2"], v["mh"]])
    spring = np.array(
        [
            [v["kc"], -v["kc"], 0],
            [-v["kc"], v["kc"] + v["ks"], -v["ks"]],
            [0, -v["ks"], v["ks"] + v["kh"]],
        ]
    )
    damper = np.array(
        [
            [v["b1"] + v["bc"], -v["bc"], 0],
            [-v["bc"], v["b2"] + v["bc"] + v["bs"], -v["bs"]],
            [0, -v["bs"], v["bs"] + v["bh"]],
        ]
    )
    inverse = np.linalg.inv(mass)
    a = np.block([[np.zeros((3, 3)), np.eye(3)], [-inverse @ spring, -inverse @ damper]])
    return a, np.concatenate([np.zeros(3), inverse[:, 0]])


def stepped(
    values: dict[str, float], force: NDArray[np.float64], period_s: float, delay_s: float
) -> NDArray[np.float64]:
    """Position of m1 at the samples: a step from switch to sample to switch (k T + delay)."""
    a, b = states(values)
    n = len(b)
    wide = np.zeros((n + 1, n + 1))
    wide[:n, :n], wide[:n, n] = a, b
    switches = np.arange(len(force)) * period_s + delay_s
    instants = np.arange(len(force)) * period_s
    events = np.unique(np.round(np.concatenate([switches, instants]), 12))
    x, position, acting, now = np.zeros(n), np.zeros(len(force)), 0.0, 0.0
    for event in events[events <= instants[-1] + 1e-9]:
        x = (expm(wide * (event - now)) @ np.append(x, acting))[:n]
        now = event
        k = round(event / period_s)
        if abs(event - k * period_s) < 1e-9:
            position[k] = x[0]
        k = round((event - delay_s) / period_s)
        if k >= 0 and abs(event - delay_s - k * period_s) < 1e-9:
            acting = force[k]
    return position
