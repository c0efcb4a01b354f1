r"""Chains of masses by their modes, to start a fit of one with a mode more.

Seen from the motor, a device with the modes :math:`\lambda_i = \omega_i^2` and their weights,
:math:`P(s) = \sum_i w_i / (s^2 + \lambda_i)`, is a chain of as many masses, whatever it is built
like: Lanczos' tridiagonal matrix of the modes, begun with the motor (G. M. L. Gladwell, *Inverse
Problems in Vibration*, 2004, chapter 4).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bayeshaptic.models.model import Model
from bayeshaptic.models.structures import chain
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.types import Floats

_SHARES = (0.03, 0.1, 0.3, 1.0, 3.0)  # weight of a new mode over that of the whole mass
_DAMPING = (0.01, 0.05)  # ratios


def shorter_chain(model: Model) -> Model | None:
    """The chain with one mode less, held alike; None where the device has one mode or none."""
    if model.structure.modes < 2:
        return None
    structure = chain(model.structure.modes - 1, model.held)
    gone = set(model.structure.names) - set(structure.names)
    kept = tuple(p for p in model.parameters if p.name not in gone)
    return replace(model, structure=structure, parameters=kept)


def with_one_more_mode(shorter: Model, theta: Floats, model: Model, etfe: Etfe) -> Floats:
    """Vectors of `model` whose modes are those of the `shorter` one at `theta`, and one more.

    Returns
    -------
    ndarray, shape (S, P)
    """
    values = dict(zip(shorter.names, theta, strict=True)) | dict(shorter.fixed)
    squares, weights = _modes_of(values, model.structure.modes)
    low, high = etfe.band_hz
    found = []
    frequencies = 45
    for frequency in np.geomspace(low, 1.2 * high, frequencies):
        for share in _SHARES:
            masses, springs = _as_chain(
                np.append(squares, (2 * np.pi * frequency) ** 2),
                np.append(weights, share * weights[0]),
            )
            for ratio in _DAMPING:
                named = _named(values, masses, springs, ratio)
                found.append([named[name] for name in model.names])
    return np.array(found)


def _modes_of(values: dict[str, float], count: int) -> tuple[Floats, Floats]:
    """Squared angular frequencies, the rigid body's zero first, and weights, shape (n,)."""
    masses = np.array([values[f"m{n}"] for n in range(1, count + 1)])
    springs = np.array([values["kc"], *(values[f"k{n}"] for n in range(3, count + 1))])
    diagonal = np.concatenate([springs, [0.0]]) + np.concatenate([[0.0], springs])
    stiffness = np.diag(diagonal) - np.diag(springs, 1) - np.diag(springs, -1)
    scale = 1 / np.sqrt(masses)
    squares, vectors = np.linalg.eigh(stiffness * np.outer(scale, scale))
    return np.maximum(squares, 0.0), (vectors[0] * scale[0]) ** 2


def _as_chain(squares: Floats, weights: Floats) -> tuple[Floats, Floats]:
    """Masses, shape (n,), and springs, shape (n - 1,), of the chain with these modes."""
    q = np.sqrt(weights / weights.sum())
    masses, springs, before, found = [1 / weights.sum()], [], 0.0, [q]
    for _ in range(len(squares) - 1):
        image = squares * q
        spring = float(q @ image) * masses[-1] - before
        for other in found:  # all of them: rounding must not bring a mode back
            image = image - (image @ other) * other
        size = float(np.linalg.norm(image))
        q = image / size
        found.append(q)
        springs.append(spring)
        masses.append(spring**2 / (size**2 * masses[-1]))
        before = spring
    return np.array(masses), np.array(springs)


def _named(
    values: dict[str, float], masses: Floats, springs: Floats, ratio: float
) -> dict[str, float]:
    """The chain's parameters by name; its dampers are those of a damping ratio."""
    reduced = 1 / (1 / masses[:-1] + 1 / masses[1:])
    dampers = 2 * ratio * np.sqrt(springs * reduced)
    named = dict(values) | {f"m{n}": m for n, m in enumerate(masses, start=1)}
    named |= {"kc": springs[0], "bc": dampers[0]}
    for n, (spring, damper) in enumerate(zip(springs[1:], dampers[1:], strict=True), start=3):
        named |= {f"k{n}": spring, f"c{n}": damper}
    # The new mass rubs on the ground as much as the others do on average.
    ground = [values[f"b{n}"] for n in range(1, len(masses))]
    return named | {f"b{len(masses)}": sum(ground) / len(ground)}
