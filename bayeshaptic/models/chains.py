r"""Chains of masses by their modes, to start a fit of one with a mode more.

Seen from the motor, a device with the modes :math:`\lambda_i = \omega_i^2` and their weights,
:math:`P(s) = \sum_i w_i / (s^2 + \lambda_i)`, is a chain of as many masses, whatever it is built
like: Lanczos' tridiagonal matrix of the modes, begun with the motor (G. M. L. Gladwell, *Inverse
Problems in Vibration*, 2004, chapter 4).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.optimize import nnls

from bayeshaptic.models.model import Model
from bayeshaptic.models.structures import chain
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.types import Floats

_SHARES = (0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0)  # weight of a new mode over that of all masses
_DAMPING = (0.01, 0.05)  # ratios of a new mode
_LEAST = 0.002  # ratio of a spring between its masses


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
        Of no vectors where the modes at `theta` are of no chain.
    """
    values = dict(zip(shorter.names, theta, strict=True)) | dict(shorter.fixed)
    return _with_a_mode(values, _modes_of(values, model.structure.modes), model, etfe)


def with_a_mode_moved(model: Model, theta: Floats, moved: int, etfe: Etfe) -> Floats:
    """Vectors of `model` whose modes are those at `theta` but one, which is anywhere else.

    The mode of a shorter chain lies between two that it had to stand for, and a fit that grows from
    there may keep it, though no mode is where it is.

    Parameters
    ----------
    model : Model
    theta : ndarray, shape (P,)
    moved : int
        Which mode, from 1 on by its frequency.
    etfe : Etfe

    Returns
    -------
    ndarray, shape (S, P)
        Of no vectors where the modes that stay are of no chain.
    """
    values = dict(zip(model.names, theta, strict=True)) | dict(model.fixed)
    modes = _modes_of(values, model.structure.modes + 1)
    return _with_a_mode(values, tuple(np.delete(part, moved) for part in modes), model, etfe)


def _with_a_mode(
    values: dict[str, float], modes: tuple[Floats, ...], model: Model, etfe: Etfe
) -> Floats:
    """Vectors with these modes and one more, shape (S, P); all else is as in `values`.

    None where the modes are of no chain: one in which the first mass does not move, or two of one
    frequency, leave a mass of nothing.
    """
    low, high = etfe.band_hz
    found = []
    frequencies = 45
    for frequency in np.geomspace(low, 1.2 * high, frequencies):
        for share in _SHARES:
            square = (2 * np.pi * frequency) ** 2
            new = square, share * modes[1][0], 0.0
            squares, weights, rates = (
                np.append(part, one) for part, one in zip(modes, new, strict=True)
            )
            with np.errstate(all="ignore"):
                masses, springs = _as_chain(squares, weights)
            parts = np.append(masses, springs)
            if not np.all(np.isfinite(parts) & (parts > 0)):
                continue
            for ratio in _DAMPING:
                rates[-1] = 2 * ratio * np.sqrt(square)
                named = _named(values, masses, springs, squares, rates)
                found.append([named[name] for name in model.names])
    return np.array(found).reshape(-1, len(model.names))


def _modes_of(values: dict[str, float], count: int) -> tuple[Floats, Floats, Floats]:
    """Of so many masses the squared angular frequencies, weights and rates of decay, shape (n,).

    The rigid body's zero comes first; rates are 2 zeta omega.
    """
    masses = np.array([values[f"m{n}"] for n in range(1, count + 1)])
    springs = np.array([values["kc"], *(values[f"k{n}"] for n in range(3, count + 1))])
    dampers = np.array([values["bc"], *(values[f"c{n}"] for n in range(3, count + 1))])
    ground = np.array([values[f"b{n}"] for n in range(1, count + 1)])
    squares, shapes = _shapes(masses, springs)
    rates = np.diff(shapes, axis=0).T ** 2 @ dampers + shapes.T**2 @ ground
    return squares, shapes[0] ** 2, rates


def _shapes(masses: Floats, springs: Floats) -> tuple[Floats, Floats]:
    """Squared angular frequencies (n,), and motions (mass, mode), of mass one."""
    diagonal = np.concatenate([springs, [0.0]]) + np.concatenate([[0.0], springs])
    stiffness = np.diag(diagonal) - np.diag(springs, 1) - np.diag(springs, -1)
    scale = 1 / np.sqrt(masses)
    squares, vectors = np.linalg.eigh(stiffness * np.outer(scale, scale))
    return np.maximum(squares, 0.0), vectors * scale[:, None]


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
    values: dict[str, float], masses: Floats, springs: Floats, squares: Floats, rates: Floats
) -> dict[str, float]:
    """The chain's parameters by name, with the dampers that let its modes decay so, as they can."""
    # The new mass rubs on the ground as much as the others do on average, and all as they did.
    before = np.array([values[f"b{n}"] for n in range(1, len(masses))])
    ground = np.append(before, before.mean()) * (1 - 1 / len(masses))
    _, shapes = _shapes(masses, springs)
    order = np.argsort(squares)[1:]  # as the shapes are, and without the rigid body
    wanted = np.maximum(rates[order] - (shapes.T**2 @ ground)[1:], 0.0) / rates[order]
    stretched = np.diff(shapes, axis=0).T[1:] ** 2 / rates[order][:, None]
    size = np.linalg.norm(stretched, axis=0)
    # From nothing at all a fit does not find back.
    least = 2 * _LEAST * np.sqrt(springs / (1 / masses[:-1] + 1 / masses[1:]))
    dampers = np.maximum(nnls(stretched / size, wanted)[0] / size, least)
    named = dict(values) | {f"m{n}": m for n, m in enumerate(masses, start=1)}
    named |= {f"b{n}": b for n, b in enumerate(ground, start=1)}
    named |= {"kc": springs[0], "bc": dampers[0]}
    for n, (spring, damper) in enumerate(zip(springs[1:], dampers[1:], strict=True), start=3):
        named |= {f"k{n}": spring, f"c{n}": damper}
    return named


def as_two_masses(grasped: Model, theta: Floats, free: Model) -> Floats:
    """Vectors of `free` that move as a held device may at `theta`, where nobody holds that.

    The hand is left out, moves as one with the load, or is the load itself, on a motor of two
    masses that move as one.

    Returns
    -------
    ndarray, shape (3, P)
    """
    alone = dict(zip(grasped.names, theta, strict=True))
    load = {"m2": alone["m2"] + alone["mh"], "b2": alone["b2"] + alone["bh"]}
    motor = {"m1": alone["m1"] + alone["m2"], "b1": alone["b1"] + alone["b2"]}
    hand = {"bc": alone["bs"], "kc": alone["ks"], "m2": alone["mh"], "b2": alone["bh"]}
    ways = alone, alone | load, alone | motor | hand
    return np.array([[way[name] for name in free.names] for way in ways])


def as_three_masses(grasped: Model, theta: Floats, chain: Model) -> Floats:
    """The vector of a chain whose third mass is the hand of a held device at `theta`, (P,)."""
    values = dict(zip(grasped.names, theta, strict=True))
    values |= {"m3": values["mh"], "c3": values["bs"], "k3": values["ks"], "b3": values["bh"]}
    return np.array([values[name] for name in chain.names])
