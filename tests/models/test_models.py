"""Models: parameters, units, delays, priors from device files, the data or the user, and errors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from linear_bench import LHIFAM_FREE, LHIFAM_HELD, Device, tremor

import bayeshaptic as bh
from bayeshaptic.devices import load_device
from bayeshaptic.errors import InputError
from bayeshaptic.models import (
    HalfNormal,
    LogNormal,
    NearZero,
    Normal,
    Parameter,
    Uniform,
    build_model,
    free,
    grasped,
    rigid,
)
from bayeshaptic.models.parameter import unit_of
from bayeshaptic.models.response.motion import linear_motion, modal_motion
from bayeshaptic.models.start import informed, scales, starting_points
from bayeshaptic.models.structures import STRUCTURES
from bayeshaptic.recordings import Recording
from bayeshaptic.recordings.response.estimate import estimate_etfe

FREE = ("m1", "b1", "bc", "kc", "m2", "b2")


def recording(chain=LHIFAM_FREE, seconds=12.0, seed=0, held=False, force_unit="N", rms=3.0):
    rng = np.random.default_rng(seed)
    force = rms * rng.standard_normal(int(seconds / 1e-3))
    device = Device(chain)
    position = device.simulate(force)
    if held:
        position = position + device.simulate(0.1 * rms * tremor(rng, len(force), 1e-3), mass=2)
    position = position + 1e-3 * np.std(np.diff(position)) * rng.standard_normal(len(force))
    unit = "m" if force_unit == "N" else "rad"
    return Recording(force, position, 1e-3, force_unit, unit)


@pytest.fixture(scope="module")
def etfe():
    return estimate_etfe(recording())


@pytest.mark.parametrize(
    ("make", "names"),
    [(rigid, ("m", "b")), (free, FREE), (grasped, (*FREE, "bs", "ks", "mh", "bh", "kh"))],
)
def test_names_and_the_delay_comes_last(make, names):
    assert make().names == (*names, "delay_s")
    assert make("lhifam").names == names
    assert make("lhifam", delay_sd_s=2e-5).names == (*names, "delay_s")
    model = make("lhifam")
    assert model.size == len(names) == len(model.values)
    assert make.__name__ == model.name and model.name in STRUCTURES


def test_a_delay_is_known_uncertain_or_free():
    known = free("lhifam")
    assert known.fixed == {"delay_s": 2e-4}
    assert free("lhifam", delay_s=3e-4).fixed == {"delay_s": 3e-4}
    uncertain = free("lhifam", delay_s=3e-4, delay_sd_s=5e-5)
    assert uncertain.prior("delay_s") == Normal(3e-4, 5e-5, low=0.0)
    assert uncertain.values[-1] == 3e-4
    loose = free("lhifam", delay_sd_s=np.inf)
    assert loose.prior("delay_s") == HalfNormal(2e-3)  # two periods
    assert not loose.fixed
    unknown = free(period_s=4e-4)
    assert unknown.prior("delay_s") == HalfNormal(8e-4)
    assert free().parameter("delay_s").prior is None  # until the data say the period
    response = known.response(known.values, [10.0, 100.0])
    same = uncertain.response([*known.values, 2e-4], [10.0, 100.0])
    assert np.allclose(response, same, rtol=1e-12)


def test_a_device_with_an_uncertain_delay():
    from dataclasses import replace

    device = replace(load_device("lhifam"), delay_sd_s=1e-5)
    assert free(device).prior("delay_s") == Normal(2e-4, 1e-5, low=0.0)
    assert free(device, delay_s=3e-4).fixed == {"delay_s": 3e-4}  # the user's word is exact
    assert "delay_s" in free(replace(device, delay_s=None, delay_sd_s=None)).names


def test_priors_around_the_device_file():
    model = grasped("phantom")
    values = load_device("phantom").parameters["grasped"]
    assert model.prior("kc") == LogNormal(values["kc"], 0.5)
    assert model.prior("ks") == LogNormal(values["ks"], 0.7)  # people differ more than devices
    scale = 2 * (values["b1"] + values["b2"])
    assert model.prior("b1") == HalfNormal(scale)
    # The file's b2 is zero: nothing was seen, and there may be as little as one pleases.
    assert values["b2"] == 0.0
    assert model.prior("b2") == NearZero(scale, 1e-6 * scale)
    scale = 2 * (0.1 + 6.8)
    assert free("lhifam").prior("b2") == HalfNormal(scale)
    assert free("lhifam").prior("b1") == NearZero(scale, 1e-6 * scale, 0.5)  # little beside b2
    assert np.array_equal(model.values, [values[name] for name in model.names])
    centre = np.array([[model.prior(name).quantile(0.5) for name in model.names]])
    assert np.isfinite(model.log_prior(centre)).all()
    outside = centre.copy()
    outside[0, model.names.index("b1")] = -1e-9
    assert model.log_prior(outside)[0] == -np.inf


def test_a_rigid_device_is_the_sum_of_its_parts():
    from dataclasses import replace

    device = load_device("lhifam")
    bare = replace(device, parameters={"free": device.parameters["free"]})
    assert rigid(bare).values == pytest.approx([5.39, 6.9])


def test_the_users_own_priors_replace_the_others(etfe):
    mine = {"kc": Uniform(1e4, 1e5), "m1": LogNormal(0.2, 0.1)}
    model = free("lhifam", prior=mine)
    assert model.prior("kc") == mine["kc"] and model.prior("m1") == mine["m1"]
    assert model.prior("m2") == free("lhifam").prior("m2")
    weak = informed(free(prior=mine), etfe)
    assert weak.prior("kc") == mine["kc"]
    assert isinstance(weak.prior("m2"), LogNormal)
    with pytest.raises(InputError, match="no parameter kk in the free model; it has m1, b1"):
        free("lhifam", prior={"kk": Uniform(0, 1)})
    with pytest.raises(InputError, match="no parameter ks"):
        free("lhifam").with_prior({"ks": Uniform(0, 1)})


@pytest.mark.parametrize(
    ("force", "position", "mass", "damping", "stiffness"),
    [
        ("N", "m", "kg", "N s/m", "N/m"),
        ("Nm", "rad", "kg m^2", "N m s/rad", "N m/rad"),
        ("A", "rad", "A s^2/rad", "A s/rad", "A/rad"),
        ("A", "m", "A s^2/m", "A s/m", "A/m"),
    ],
)
def test_units(force, position, mass, damping, stiffness):
    units = [unit_of(kind, force, position) for kind in ("mass", "damping", "stiffness")]
    assert units == [mass, damping, stiffness]
    assert unit_of("time", force, position) == "s"
    assert unit_of("position", force, position) == position


def test_units_of_models(etfe):
    assert free("lhifam").unit("kc") == "N/m"
    assert free("phantom").unit("kc") == free("phantom").stiffness_unit == "N m/rad"
    assert free("lhifam", delay_sd_s=1e-5).unit("delay_s") == "s"


def test_a_force_in_amperes_gives_units_in_amperes():
    etfe = estimate_etfe(recording(force_unit="A"))
    model = informed(free(), etfe)
    assert model.unit("kc") == model.stiffness_unit == "A/rad"
    assert model.unit("m1") == "A s^2/rad"
    assert model.period_s == 1e-3


@pytest.mark.parametrize(("chain", "held"), [(LHIFAM_FREE, False), (LHIFAM_HELD, True)])
def test_the_scales_of_an_unknown_device(chain, held):
    """The mass lies between the motor's and the whole; a peak stands where a vibration mode is."""
    found = scales(estimate_etfe(recording(chain, held=held, seed=2)))
    masses = chain["masses"]
    assert 0.8 * masses[0] < found.mass < 1.2 * sum(masses)
    poles = np.linalg.eigvals(Device(chain).a)
    modes = np.abs(poles[np.abs(poles.imag) > 5 * np.abs(poles.real)]) / (2 * np.pi)
    assert np.abs(np.log(found.peaks_hz[:, None] / modes)).min() < 0.05


@pytest.mark.parametrize("make", [rigid, free, grasped])
def test_weak_priors_and_starts_make_sense(make, etfe):
    model = informed(make(), etfe)
    assert model.has_priors and model.names[-1] == "delay_s"
    starts = starting_points(model, etfe, np.random.default_rng(0))
    assert starts.shape[1] == model.size and len(starts) > 100
    assert np.isfinite(starts).all() and (starts >= 0).all()
    assert np.isfinite(model.log_prior(starts)).all()
    response = model.response(starts[:64], etfe.frequency_hz)
    assert np.isfinite(response).all()
    again = starting_points(model, etfe, np.random.default_rng(0))
    assert np.array_equal(starts, again)


def test_shapes_of_the_response():
    model = grasped("lhifam")
    one = model.response(model.values, [1.0, 10.0, 100.0])
    many = model.response(np.tile(model.values, (200, 1)), [1.0, 10.0, 100.0])
    assert one.shape == (3,) and many.shape == (200, 3)
    assert np.allclose(many, one, rtol=1e-12)
    assert model.log_prior(np.tile(model.values, (4, 1))).shape == (4,)


def test_another_period():
    model = free("lhifam").with_period(5e-4)
    assert model.period_s == 5e-4
    assert free("lhifam", period_s=5e-4).period_s == 5e-4
    assert not np.allclose(
        model.response(model.values, [100.0]),
        free("lhifam").response(model.values, [100.0]),
        rtol=1e-3,
    )


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: build_model("stiff"), "no model 'stiff'; there are rigid, free, grasped"),
        (lambda: free("no-such-device"), "no-such-device"),
        (lambda: free(delay_s=-1e-4), "delay_s is -0.0001; give"),
        (lambda: free(delay_s=np.nan), "delay_s is nan; give"),
        (lambda: free(delay_s=1e-4, delay_sd_s=-1.0), "delay_sd_s is -1.0; give"),
        (lambda: free(period_s=0.0), "period_s is 0.0; give"),
        (lambda: free(period_s=1000.0), "period_s is 1000.0 s"),
        (lambda: free().values, "no values for m1, b1"),
        (lambda: free().prior("kc"), "prior of kc is not set"),
        (lambda: free().response(np.ones(7), [1.0]), "no sampling period"),
        (lambda: free("lhifam").response(np.ones(5), [1.0]), "has 6 parameters .* 5 were given"),
        (
            lambda: free("lhifam").response(free("lhifam").values, [1.0], "pade"),
            'approximation is "exact" or "continuous", not .pade.',
        ),
    ],
)
def test_wrong_use_is_refused_in_one_line(call, message):
    with pytest.raises(InputError, match=message) as caught:
        call()
    assert "\n" not in str(caught.value)


def test_a_device_file_with_an_impossible_value():
    from dataclasses import replace

    device = load_device("lhifam")
    values = dict(device.parameters["free"], kc=0.0)
    with pytest.raises(InputError, match="kc = 0.0; it must be positive"):
        free(replace(device, parameters={"free": values}))


def test_motion_of_a_mass_without_damping_is_its_force_twice_integrated() -> None:
    model = rigid(delay_s=0.0, period_s=1e-3, prior={"m": LogNormal(2.0, 0.1)})
    force = np.random.default_rng(0).normal(size=5000)
    position, velocity = linear_motion(model.system(np.array([[2.0, 0.0]])), force, 1e-3)
    wanted_velocity = np.concatenate([[0.0], np.cumsum(force)[:-1]]) * 1e-3 / 2.0
    steps = 1e-3 * wanted_velocity + 0.5e-6 * force / 2.0
    wanted = np.concatenate([[0.0], np.cumsum(steps)[:-1]])
    # Poles 1e-5 rad/s apart over 5 s.
    assert np.abs(velocity - wanted_velocity).max() < 5e-5 * np.abs(wanted_velocity).max()
    assert np.abs(position - wanted).max() < 5e-5 * np.abs(wanted).max()


def test_a_device_file_with_some_values_only() -> None:
    device = replace(load_device("lhifam"), parameters={"free": {"m1": 0.2, "b1": 0.0}})
    model = free(device=device, period_s=1e-3, delay_s=1e-4)
    assert model.prior("m1") == LogNormal(0.2, 0.5)
    assert not model.has_priors  # the others come from the data
    with pytest.raises(InputError, match="no values for bc, kc"):
        free(device=device).values  # noqa: B018
    assert rigid(device=device).names[:2] == ("m", "b")


@pytest.mark.parametrize(("substeps", "whole"), [(1, 0), (8, 3), (8, 19), (3, 40)])
def test_modes_in_time_are_those_of_step_after_step(substeps, whole):
    rng = np.random.default_rng(8)
    decay, new, old, *weights = rng.normal(size=(5, 3)) + 1j * rng.normal(size=(5, 3))
    decay *= 0.95 / np.abs(decay)
    force = rng.normal(size=12)
    held = np.concatenate([np.zeros(whole), np.repeat(force, substeps)])[: 12 * substeps]
    state, before, stepped = np.zeros(3, complex), 0.0, []
    for now in held:
        stepped.append([(weight * state).sum().real for weight in weights])
        state = state * decay + new * now + old * before
        before = now
    found = modal_motion(force, substeps, whole, decay, new, old, np.array(weights))
    np.testing.assert_allclose(found, np.transpose(stepped), rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("approximation", ["exact", "continuous"])
def test_under_a_constant_force_a_free_device_runs_away_and_a_held_one_gives_way(approximation):
    """Its compliance is that of the springs in a row to the ground."""
    loose, held = bh.free(device="lhifam"), bh.grasped(device="lhifam")
    values = dict(zip(held.names, held.values, strict=True))
    compliance = sum(1 / values[name] for name in ("kc", "ks", "kh"))
    two = np.stack([held.values, held.values])
    assert np.allclose(held.response(two, [0.0, 1.0], approximation)[:, 0], compliance, rtol=1e-12)
    assert loose.response(loose.values, 0.0, approximation) == np.inf
    assert np.isfinite(loose.response(loose.values, [1.0], approximation))
    alone, beside = (loose.response(loose.values, f, approximation) for f in ([1.0], [0.0, 1.0]))
    assert alone[0] == beside[1]


def test_a_known_value_is_one_that_the_parameter_can_have():
    model = bh.free(device="lhifam", prior={"kc": bh.Uniform(1e4, 1e5)})
    for known, words in (
        ({"m1": -1}, "m1 is -1; a mass of the motor side can be above 0"),
        ({"m1": 0}, "above 0"),
        ({"b1": -0.1}, "b1 is -0.1; .* from 0 on"),
        ({"kc": 1.0}, "kc is 1; .* from 10000 on, up to 100000"),
        ({"kc": np.inf}, "kc"),
    ):
        with pytest.raises(InputError, match=words):
            model.with_known(known)
    with pytest.raises(InputError, match="delay_s is -0.0001; a loop delay can be from 0 on"):
        bh.rigid().with_known({"delay_s": -1e-4})
    assert model.with_known({"m1": 0.2, "b1": 0, "other": -1}).fixed["b1"] == 0.0
    # A delay beyond the declared one is below zero where the loop has less than was declared.
    later = Parameter("extra_delay_s", "time", "delay", Normal(0.0, 1e-3, low=-2e-4))
    assert later.known(-1e-4) == -1e-4
    with pytest.raises(InputError, match="from -0.0002 on"):
        later.known(-3e-4)
