"""A recording with something in it that nobody declared: python examples/undeclared_effect.py

A walk through closing the loop, for somebody who has not done it before. `lhifam-user-b.csv.gz` is
a large haptic device in a user's hand. Its file says force and position and nothing else; something
is in it that the model does not have.

1. Fit the model as declared. Taken by itself it looks like an answer: a stiffness, an interval.
2. Ask whether what it leaves over is noise. It is not, and the tests say of which kind it is.
3. Look at the force that the model leaves over. A step where the velocity changes its sign is what
   dry friction looks like; the slope beside it is the viscous damping that the fit made up for it,
   and that is not there at large amplitude.
4. Let the loop try the library's effects. It accepts one only if it predicts a part of the
   recording that it was not fitted to.
5. Compare: the error on held-out data, the critical stiffness, and what the measurement says
   without any model.

`bayeshaptic report data/recordings/lhifam-user-b.csv.gz --device lhifam` does all of it by itself,
with figures. The truth stands at the end of this file.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import bayeshaptic as bh
from bayeshaptic.diagnosis.battery import residual_tests
from bayeshaptic.diagnosis.residuals.columns import motions
from bayeshaptic.diagnosis.residuals.force_curve import force_curve
from bayeshaptic.effects.nonlinear.shapes import VELOCITY

RECORDING = Path(__file__).parents[1] / "data" / "recordings" / "lhifam-user-b.csv.gz"


def first_answer(recording: bh.Recording) -> bh.Fit:
    """Steps 1 and 2: the declared model, and whether its residual is noise."""
    etfe = bh.estimate_etfe(recording)
    fit = bh.least_squares(bh.grasped(device="lhifam"), etfe)
    limit = bh.critical_stiffness(fit)
    print(f"1. as declared: critical stiffness {limit.value / 1e3:.1f} kN/m")
    print(f"   reduced chi-square {fit.reduced_chi_square:.2f}: 1 would be noise")
    for test in residual_tests(fit, etfe):
        if test.flagged:
            print(f"2. {test.family}: {test.text}")
    return fit


def picture(fit: bh.Fit, recording: bh.Recording) -> None:
    """Step 3: the force that is left over, against the velocity, as a picture of text."""
    print("3. force that the model leaves over, by the velocity of the motor:")
    velocity_of_motor = motions(fit, recording)[VELOCITY]
    curve = force_curve(fit, bh.estimate_etfe(recording), VELOCITY, velocity_of_motor)
    largest = max(abs(curve.force))
    for velocity, force in zip(curve.motion, curve.force, strict=True):
        place = round(24 * force / largest)
        line = [" "] * 49
        line[24], line[24 + place] = "|", "o"
        print(f"   {velocity:+8.4f} m/s  {''.join(line)}  {force:+.2f} N")


def closed(recording: bh.Recording, ess: float) -> bh.Closed:
    """Steps 4 and 5: what explains it, and what that changes."""
    found = bh.close_loop(recording, "grasped", device="lhifam", ess=ess)
    for candidate in sorted(found.traced.candidates, key=lambda c: -c.score)[:5]:
        verdict = "accepted" if candidate.accepted else "not needed"
        print(f"4. {candidate.title}: held-out gain {candidate.score:.0f}, {verdict}")
    for effect in found.effects:
        for name, estimate in effect.estimates.items():
            sd = "" if estimate.sd != estimate.sd else f" ± {estimate.sd:.2g}"
            print(f"   {effect.name}: {name} {estimate.mean:.3g}{sd} {estimate.unit}")
    # Both beside the same measurement: that with the friction taken off it.
    before = found.before_like_after or found.before
    for when, error in (("before", before), ("after", found.after)):
        limit = error["critical_stiffness"]
        print(
            f"5. {when}: held-out error {error['held_out_weighted_rms']:.2f} times the noise, "
            f"K_CR {limit['q50'] / 1e3:.1f} ({limit['q05'] / 1e3:.1f} to {limit['q95'] / 1e3:.1f}) "
            "kN/m"
        )
    own = found.analysis.etfe_limit
    if own.q50:
        print(f"   the response without a model, friction taken off: {own.q50 / 1e3:.1f} kN/m")
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--ess", type=float, default=2000, help="effective draws (2000)")
    arguments = parser.parse_args()
    recording = bh.read_recording(RECORDING)
    picture(first_answer(recording), recording)
    closed(recording, arguments.ess)
    print("the truth: 0.6 N of Coulomb friction on the motor's mass, and 22.27 kN/m without it")


if __name__ == "__main__":
    main()
