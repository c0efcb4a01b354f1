"""A device file that the recording contradicts."""

from __future__ import annotations

from dataclasses import replace

import pytest

from bayeshaptic.devices import load_device
from bayeshaptic.diagnosis.base.file_in_doubt import file_in_doubt
from bayeshaptic.diagnosis.options import Options
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.models import LogUniform, build_model
from bayeshaptic.recordings import recording_from_arrays
from bayeshaptic.recordings.response.estimate import estimate_etfe
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.rig import Bench, WhiteNoise, simulate


@pytest.fixture(scope="module")
def etfe() -> Etfe:
    bench = Bench.from_device("lhifam")
    run = simulate(bench, WhiteNoise(3.0, 300.0, 0.3, 10.0), seed=1)
    return estimate_etfe(recording_from_arrays(run.force, run.position, period_s=1e-3))


@pytest.mark.parametrize(
    ("name", "factor", "told"),
    [("kc", 1e-3, "kc is 55.3 N/m in the file and would be 55."), ("kc", 1e3, "kc is 55.3 MN/m")]
    + [("m2", 1e3, "m2 is 5200 kg"), ("kc", 1.0, ""), ("kc", 2.0, "")],
)
def test_a_value_in_another_unit_is_named(etfe: Etfe, name: str, factor: float, told: str) -> None:
    device = load_device("lhifam")
    free = {**device.parameters["free"]}
    free[name] *= factor
    wrong = replace(device, parameters={"free": free})
    fit = least_squares(build_model("free", wrong, period_s=etfe.period_s), etfe)
    texts = [one.text for one in file_in_doubt(etfe, {"free": fit}, wrong, Options())]
    assert len(texts) == bool(told)
    assert all(told in text for text in texts)


def test_a_prior_of_another_model_is_no_matter(etfe: Etfe) -> None:
    """A study's prior of m1 ended each of its reports where the rigid model was tried, too."""
    device = load_device("lhifam")
    fit = least_squares(build_model("rigid", device, period_s=etfe.period_s), etfe)
    assert fit.misfits
    options = Options(prior={"m1": LogUniform(0.1, 10.0)})
    assert file_in_doubt(etfe, {"rigid": fit}, device, options) == ()


def test_what_one_set_of_values_explains_leaves_the_others_alone() -> None:
    """A grasped model of free values explains what nobody holds, as no hand of the file does."""
    run = simulate(Bench.from_device("phantom"), WhiteNoise(0.1, 200.0, 0.7, 10.0), seed=2)
    force, position = run.force, run.position
    recording = recording_from_arrays(force, position, 1e-3, kind="rotational")
    device, etfe = load_device("phantom"), estimate_etfe(recording)
    fits = {
        name: least_squares(build_model(name, device, period_s=etfe.period_s), etfe)
        for name in ("free", "grasped")
    }
    assert not fits["free"].misfits and fits["grasped"].misfits
    assert file_in_doubt(etfe, {"grasped": fits["grasped"]}, device, Options())
    assert file_in_doubt(etfe, fits, device, Options()) == ()
