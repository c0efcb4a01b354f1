"""Devices of any size in closed loop: of a millionth to a hundred units of mass, 0.1 to 4 ms.

    python -m benchmarks.strangers.any_loop [COUNT] [FIRST] [FILE] [--clean]

Devices of `any_device`, half of them one mass that nobody holds, under the controllers of `loops`,
whose rates and ways are as much quicker or slower as their period is.  Half have dry friction; some
have effects of the strangers' besides, and some are cut off at their limits.  Told are, of some,
`held`, a model, the delay, the reference as a column, a declared controller.  With --clean nothing
but dry friction is in them.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from bayeshaptic.recordings.recording import Recording
from benchmarks.strangers.any_device import (
    PERIODS_S,
    USUAL_S,
    delay_in_steps,
    device_of,
    limit_of,
    main,
    size_in_periods,
)
from benchmarks.strangers.draw import UNITS, Case, Draw, as_logged, effects_of, states_of
from benchmarks.strangers.loops import (
    REFERENCES,
    known_of,
    law_of,
    simulated,
    wanted_of,
    with_loop_told,
)


def make(seed: int, clean: bool = False) -> Case | None:
    """The recording of a seed; none where the device, or the loop, runs away."""
    rng = np.random.default_rng([53, seed])
    draw = Draw(rng, str(rng.choice(["lhifam", "phantom"])), bool(rng.random() < 0.3), True)
    period_s, mass = float(rng.choice(PERIODS_S)), 10 ** rng.uniform(-6, 2)
    draw.values = device_of(draw, mass, period_s)
    if not draw.held and rng.random() < 0.6:
        draw.values["m"] = np.atleast_1d(draw.values["m"].sum())
    effects = effects_of(draw) if rng.random() < 0.5 else ()
    friction = bool(rng.random() < 0.5) and not {"coulomb", "stribeck"} & set(effects)
    effects = (() if clean else effects) + ("coulomb",) * friction
    longer = period_s / USUAL_S
    sizes = {name: size_in_periods(draw, name, longer) for name in effects}
    delay_s = delay_in_steps(draw, sizes, period_s, 3)
    device = states_of(draw, sizes)
    truth = limit_of(device, mass, period_s, delay_s)
    kind = str(rng.choice(REFERENCES))
    law, name = law_of(draw, truth, period_s, longer)
    wanted = wanted_of(draw, kind, int(draw.between(3000, 30_000)), period_s, longer)
    wanted *= 10 ** rng.uniform(-3.3, -1) / wanted.std()
    law = replace(law, count=wanted.std() / 10 ** rng.uniform(1.5, 4.5))
    if rng.random() < 0.2:  # cut off at its limits now and then
        law = replace(law, most=law.spring * wanted.std() * rng.uniform(0.7, 2))
    made = simulated(draw, sizes, device, wanted, law, period_s, delay_s)
    if made is None:
        return None
    force, position, friction_force = made
    force, position, count = as_logged(draw, effects, force, position, period_s)
    count = count if "coarse" in effects else law.count
    position = count * np.round(position / count)
    recording = Recording(force, position, period_s, *UNITS[draw.like], f"any-loop-{seed}")
    base, parameters = known_of(draw, effects, delay_s, friction_force)
    told: dict[str, Any] = {"held": draw.held} if rng.random() < 0.6 else {}
    if rng.random() < 0.5:
        told["model"] = base
    if "late" not in effects and rng.random() < 0.4:
        told["delay_s"] = delay_s
    recording, also = with_loop_told(rng, recording, law, wanted)
    what = (
        f"{len(draw.values['m'])} masses {'held' if draw.held else 'free'}, {mass:.1e}, "
        f"{1e3 * period_s:.3g} ms, {len(force)} samples, {name}, {kind}, "
        f"told {', '.join([*told, *also]) or 'nothing'}"
    )
    return Case(recording, told, what, effects, truth, base, parameters)


if __name__ == "__main__":
    main(__doc__, make)
