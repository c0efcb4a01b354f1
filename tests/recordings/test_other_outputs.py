"""Velocities, accelerations and measured forces, read as a command and a position."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import butter, lfilter

import bayeshaptic as bh
from bayeshaptic.diagnosis.base.begun import begin
from bayeshaptic.diagnosis.base.opened import with_delay_of_the_loop
from bayeshaptic.diagnosis.options import Options
from bayeshaptic.diagnosis.samples.mend import measurement_tests
from bayeshaptic.errors import InputError
from bayeshaptic.inference import loop_response
from bayeshaptic.models.build import with_force_sensor
from bayeshaptic.models.response.between_samples import with_images
from bayeshaptic.recordings.response.differences import with_differences
from bayeshaptic.recordings.signals.causality.causality import causality
from benchmarks.strangers.sensed import make

PERIOD_S, SAMPLES = 1e-3, 4000
RATES_HZ = np.arange(1.0, 151.0)  # one period a second


@pytest.fixture(scope="module")
def device():
    """A free device whose mode lies at 60 Hz, without a delay, and its parameters."""
    model = bh.free(delay_s=0.0, period_s=PERIOD_S)
    values = {"m1": 0.2, "b1": 1.0, "bc": 0.6, "kc": 0.1 * (2 * np.pi * 60) ** 2, "m2": 0.2}
    return model, np.array([{**values, "b2": 0.5}[name] for name in model.names])


def continuous(device):
    """Tones of a force, and the motion of the device with no hold between: every output, (N,)."""
    model, theta = device
    s = 2j * np.pi * RATES_HZ
    rng = np.random.default_rng(4)
    tones = np.exp(2j * np.pi * rng.uniform(size=len(s)))
    response = model.system(theta).continuous_response(s)[0]
    time = np.arange(SAMPLES) * PERIOD_S
    waves = np.exp(np.outer(time, s))
    signals = {"t": time, "u": waves @ tones}
    signals |= {name: waves @ (tones * response * s**n) for n, name in enumerate("xva")}
    return {name: np.real(values) for name, values in signals.items()}


@pytest.mark.parametrize(
    "output", ["position=x[m]", "velocity=v[m/s]", "acceleration=a[m/s^2]", "velocity=v*1e3[mm/s]"]
)
def test_a_continuous_experiment_gives_the_response_of_a_held_command(device, output, tmp_path):
    """Within a few thousandths up to 150 Hz of 1 kHz, whatever was recorded of the motion."""
    path = tmp_path / "shaker.npz"
    np.savez(path, **continuous(device))
    recording = bh.read_recording(path, columns=f"time=t,measured_force=u[N],{output}")
    assert (recording.force_unit, recording.position_unit) == ("N", "m")
    assert recording.notices[0].topic == "hold"
    settled = slice(500, 3500)
    force, position = recording.force[settled], recording.position[settled]
    lines = np.exp(-2j * np.pi * np.outer(RATES_HZ, np.arange(3000) * PERIOD_S))
    found = (lines @ position) / (lines @ force)
    model, theta = device
    expected = model.response(theta, RATES_HZ)
    assert np.max(np.abs(found / expected - 1)) < 6e-3


def test_a_sensor_of_the_force_that_lags_is_none_of_the_loop(device, tmp_path):
    """One that lets pass 200 Hz: found as a lag, the limit is that of the loop without it."""
    model, theta = device
    lag_s, loop_delay_s = 1 / (2 * np.pi * 200), 5e-4
    rng = np.random.default_rng(7)
    s = 2j * np.pi * RATES_HZ
    tones = np.exp(2j * np.pi * rng.uniform(size=len(s)))
    time = np.arange(SAMPLES) * PERIOD_S
    waves = np.exp(np.outer(time, s))
    force = np.real(waves @ (tones / (1 + lag_s * s)))
    position = np.real(waves @ (tones * model.system(theta).continuous_response(s)[0]))
    position += 3e-4 * position.std() * rng.standard_normal(SAMPLES)
    path = tmp_path / "slow.npz"
    np.savez(path, t=time, u=force, x=position)
    recording = bh.read_recording(path, columns="time=t,measured_force=u[N],position=x[m]")
    told = Options(delay_s=loop_delay_s)
    found = begin(recording, "free", told).fit
    assert found.model.names[-1] == "force_lag_s" and not found.misfits
    value = dict(zip(found.model.names, found.theta, strict=True))
    sd = dict(zip(found.model.names, found.sd, strict=True))
    assert abs(value["force_lag_s"] - lag_s) < 4 * sd["force_lag_s"] < 0.4 * lag_s
    loop = bh.free(delay_s=loop_delay_s, period_s=PERIOD_S)
    true = bh.critical_stiffness(loop, theta).value
    assert bh.critical_stiffness(found.model, found.theta).value == pytest.approx(true, rel=0.05)
    without = begin(recording, loop, told).fit
    assert without.reduced_chi_square > 100


def test_the_lag_of_a_sensor_is_seen_and_not_in_the_loop(device):
    """(1 + s lag) of the response is measured; the loop and its limit know nothing of it."""
    model, theta = device
    lagging = with_force_sensor(model)
    whole = np.insert(theta, lagging.names.index("force_lag_s"), 1e-3)
    s = 2j * np.pi * RATES_HZ
    seen = lagging.measured_system(whole).continuous_response(s)[0]
    assert seen == pytest.approx(model.system(theta).continuous_response(s)[0] * (1 + 1e-3 * s))
    assert np.array_equal(lagging.response(whole, RATES_HZ), model.response(theta, RATES_HZ))
    none = np.where(np.array(lagging.names) == "force_lag_s", 0.0, whole)
    assert lagging.response(none, RATES_HZ, measured=True) == pytest.approx(
        model.response(theta, RATES_HZ)
    )
    limits = [bh.critical_stiffness(lagging, v).value for v in (whole, none)]
    assert limits[0] == limits[1] == bh.critical_stiffness(model, theta).value


def test_what_is_between_the_samples_is_added_in_the_band_alone():
    """At the Nyquist frequency a measured force has no command: divided by, noise was 1e5 times."""
    case = make(137)
    begun = begin(case.recording, "free", Options(**case.told))
    put_right, measured = begun.etfe.recording, begun.measured.recording
    assert 0 < np.std(put_right.position - measured.position) < 0.01 * np.std(measured.position)


def test_a_fit_does_not_run_away_with_what_is_between_the_samples(monkeypatch):
    """Of a first fit in another valley; with each round its misfit grew, to 1e10 of the noise."""
    fits = iter([40.0, 150.0, 7e3])

    def fitting(etfe, start=None):
        return SimpleNamespace(reduced_chi_square=next(fits), theta=0.0)

    monkeypatch.setattr(loop_response, "as_of_the_loop", lambda etfe, fit: object())
    monkeypatch.setattr(loop_response, "hardly_differ", lambda one, other: False)
    first = fitting(None)
    fit, etfe = loop_response._settled(fitting, "measured", first, "first")
    assert fit is first and etfe == "first"


def test_estimates_of_other_windows_differ():
    """Through a reference the band is where that moves the force, which is seen anew."""
    frequency, value = np.arange(1.0, 97.0), np.ones(96, complex)
    etfe = SimpleNamespace(frequency_hz=frequency, value=value, variance=np.full(96, 1.0))
    fewer = SimpleNamespace(
        frequency_hz=frequency[:89], value=value[:89], variance=np.full(89, 1.0)
    )
    assert loop_response.hardly_differ(etfe, etfe)
    assert not loop_response.hardly_differ(fewer, etfe)
    shifted = SimpleNamespace(frequency_hz=1.01 * frequency, value=value, variance=etfe.variance)
    assert not loop_response.hardly_differ(etfe, shifted)


def test_a_delay_that_nobody_told_is_none_of_a_measured_force():
    unknown = bh.free(period_s=PERIOD_S)
    assert with_force_sensor(unknown).fixed["delay_s"] == 0.0
    told = with_force_sensor(bh.free(delay_s=3e-4, delay_sd_s=1e-4, period_s=PERIOD_S))
    assert told.names[-2:] == ("force_lag_s", "delay_s")


def test_a_velocity_beside_a_command(device, tmp_path):
    """Under a held force the velocity's integral is the position, as close as the notice says."""
    from scipy.linalg import expm

    model, theta = device
    value = dict(zip(model.names, theta, strict=True))
    m1, m2, k, c = (value[name] for name in ("m1", "m2", "kc", "bc"))
    rates = [[0, 0, 1, 0], [0, 0, 0, 1]]
    rates.append([-k / m1, k / m1, -(c + value["b1"]) / m1, c / m1])
    rates.append([k / m2, -k / m2, c / m2, -(c + value["b2"]) / m2])
    whole = np.zeros((5, 5))
    whole[:4, :4], whole[2, 4] = rates, 1 / m1
    step = expm(whole * PERIOD_S)
    rng = np.random.default_rng(8)
    tones = 2 * np.pi * RATES_HZ[:, None] * np.arange(9000) * PERIOD_S
    force = np.cos(tones + rng.uniform(0, 2 * np.pi, (len(RATES_HZ), 1))).sum(axis=0)
    state, states = np.zeros(4), np.zeros((9000, 4))
    for row, push in enumerate(force):
        states[row] = state
        state = step[:4, :4] @ state + step[:4, 4] * push
    recording = tacho(tmp_path / "tacho.npz", force, states[:, 2])
    lines = np.exp(-2j * np.pi * np.outer(RATES_HZ, np.arange(3000) * PERIOD_S))
    position = recording.position
    position = position - (position[8000] - position[7000]) / 1000 * np.arange(9000)  # of its mean
    found = (lines @ position[5900:8900]) / (lines @ recording.force[5900:8900])
    off = np.abs(found / model.response(theta, RATES_HZ) - 1)
    rate = 2 * np.pi * RATES_HZ
    of_the_motor = off * np.abs(model.response(theta, RATES_HZ)) * m1 * rate**2
    assert 0.025 < of_the_motor[99] < 0.036  # 3.3 % at 100 Hz, as the recording's notice says
    put_right = with_images(recording, model.system(theta))
    shown = put_right.position - recording.position
    found = found + (lines @ shown[5900:8900]) / (lines @ recording.force[5900:8900])
    assert np.max(np.abs(found / model.response(theta, RATES_HZ) - 1)) < 1e-4


def test_a_velocity_beside_a_command_is_no_feedback(tmp_path):
    """Its integral through splines knows the next samples, and with them what is commanded now."""
    rng = np.random.default_rng(3)
    force = rng.standard_normal(6000)
    speed = lfilter([0.0, 1e-3 / 0.5], [1.0, -np.exp(-3e-3)], force)
    speed += 1e-4 * np.std(speed) * rng.standard_normal(6000)
    recording = tacho(tmp_path / "tacho.npz", force, speed)
    assert causality(replace(recording, sensed=None)).has_feedback
    judged = causality(recording)
    assert not judged.has_feedback and not judged.doubtful
    assert len(recording.part(100, 400).sensed.output) == 300


@pytest.mark.parametrize("table", [True, False])
def test_the_delay_of_the_loop_is_put_in_where_it_is_known(device, table, tmp_path):
    """A hammer and a sensor of the force know nothing of it; the limit depends on it."""
    model, theta = device
    if table:
        s = 2j * np.pi * RATES_HZ
        response = model.system(theta).continuous_response(s)[0]
        rows = (RATES_HZ, 20 * np.log10(np.abs(response)), np.angle(response, deg=True))
        path = tmp_path / "hammer.csv"
        header = "frequency_hz,receptance_db,phase_deg,sd"
        columns = np.stack([*rows, 1e-3 * np.abs(response)], axis=1)
        np.savetxt(path, columns, delimiter=",", header=header, comments="")
        seen = bh.read_frf(path, period_s=PERIOD_S, kind="translational")
    else:
        path = tmp_path / "shaker.npz"
        np.savez(path, **continuous(device))
        seen = bh.read_recording(path, columns="time=t,measured_force=u[N],position=x[m]")
    (warned,) = with_delay_of_the_loop(seen, None, Options())[1]
    assert "--delay-s" in warned.text
    with pytest.raises(InputError, match="shows nothing of the loop's delay"):
        with_delay_of_the_loop(seen, None, Options(prior={"delay_s": bh.HalfNormal(1e-3)}))
    late, none = with_delay_of_the_loop(seen, None, Options(delay_s=1.3e-3))
    assert none == ()
    if table:
        found, expected = late.value, model.response(theta, RATES_HZ)
    else:
        settled = slice(500, 3500)
        lines = np.exp(-2j * np.pi * np.outer(RATES_HZ, np.arange(3000) * PERIOD_S))
        found = (lines @ late.position[settled]) / (lines @ late.force[settled])
        expected = model.response(theta, RATES_HZ)
    expected = expected * np.exp(-2j * np.pi * RATES_HZ * 1.3e-3)
    assert np.max(np.abs(found / expected - 1)) < 6e-3


def test_what_cannot_be_told_is_refused(tmp_path):
    path = tmp_path / "a.npz"
    time = np.arange(50) * PERIOD_S
    np.savez(path, t=time, u=np.sin(time), a=np.cos(time))
    with pytest.raises(InputError, match="half a period of delay open"):
        bh.read_recording(path, columns="time=t,force=u,acceleration=a")
    with pytest.raises(InputError, match="both position and velocity"):
        bh.read_recording(path, columns="time=t,force=u,position=a,velocity=a")
    with pytest.raises(InputError, match="no unit of velocity"):
        bh.read_recording(path, columns="time=t,force=u,velocity=a[mm]")


@pytest.mark.parametrize("output", ["tachometer", "differences", "filtered", "filtered, held"])
def test_differences_of_an_encoder_are_told_from_a_tachometer(output, tmp_path):
    """By the colour of their noise: summed up, or refused where a filter levelled it."""
    rng = np.random.default_rng(5)
    force = rng.standard_normal(8000)
    keep = np.exp(-3e-3)
    speed = lfilter([0.0, (1 - keep) / 3], [1.0, -keep], force)
    position = np.cumsum(speed) * PERIOD_S  # at each sample that of the mean speed before it
    count = 2e-7
    seen = {"tachometer": speed + 3e-4 * rng.standard_normal(8000)}
    seen["differences"] = np.diff(count * np.round(position / count), prepend=0.0) / PERIOD_S
    seen["filtered"] = lfilter([0.4], [1.0, -0.6], seen["differences"])
    # A hand hides how the noise rises below what the filter levels.
    hand = lfilter(*butter(4, 2 * 5 * PERIOD_S), 0.1 * rng.standard_normal(8000))
    seen["filtered, held"] = lfilter([0.45], [1.0, -0.55], seen["differences"] + hand)
    path = tmp_path / "speed.npz"
    recording = tacho(path, force, seen[output])
    if output.startswith("filtered"):
        with pytest.raises(InputError, match="they were filtered"):
            with_differences(recording)
        return
    told = with_differences(recording)
    assert (told.sensed is None) == (output == "differences")
    if output == "differences":
        assert np.allclose(told.position, count * np.round(position / count))


@pytest.mark.parametrize("output", ["tachometer", "differences"])
def test_noise_is_looked_at_where_there_is_no_force_too(output, tmp_path):
    """A multisine to 150 Hz leaves no power at the fast lines: every tachometer was refused."""
    rng = np.random.default_rng(6)
    tones = np.where(np.arange(1001) < 300, np.exp(2j * np.pi * rng.uniform(size=1001)), 0.0)
    force = np.tile(np.fft.irfft(tones), 5)
    keep = np.exp(-3e-3)
    speed = lfilter([0.0, (1 - keep) / 3], [1.0, -keep], force)
    count = 1e-3 * np.std(np.cumsum(speed)) * PERIOD_S
    position = count * np.round(np.cumsum(speed) * PERIOD_S / count)
    noise = 1e-2 * np.std(speed) * rng.standard_normal(len(speed))
    seen = {"tachometer": speed + noise, "differences": np.diff(position, prepend=0.0) / PERIOD_S}
    told = with_differences(tacho(tmp_path / "speed.npz", force, seen[output]))
    assert (told.sensed is None) == (output == "differences")


def gains_of_one_mass(mass, damping, delay_s):
    """The velocity's filter from a held command, [0, 1 - late, late - keep] / b over 1 - keep/z."""
    keep = np.exp(-damping / mass * PERIOD_S)
    late = np.exp(-damping / mass * (PERIOD_S - delay_s))
    return np.array([0.0, 1 - late, late - keep]) / damping, keep


def tacho(path, force, speed):
    """The recording of a file with a command and a velocity."""
    np.savez(path, t=np.arange(len(force)) * PERIOD_S, u=force, v=speed)
    return bh.read_recording(path, columns="time=t,force=u[N],velocity=v[m/s]")


def tacho_of_one_mass(path, noise, pushed=0.0):
    """A rigid device under noise; beside the command something pushes it at low frequencies."""
    mass, damping, delay_s = 0.3, 2.0, 3e-4
    rng = np.random.default_rng(7)
    force = rng.standard_normal(12000)
    gains, keep = gains_of_one_mass(mass, damping, delay_s)
    besides = lfilter(*butter(2, 2 * 20 * PERIOD_S), pushed * rng.standard_normal(12000))
    speed = lfilter(gains, [1.0, -keep], force)
    speed += lfilter([0.0, (1 - keep) / damping], [1.0, -keep], besides)
    speed += noise * np.std(speed) * rng.standard_normal(12000)
    recording = tacho(path, force, speed)
    return recording, np.array([mass, damping]), delay_s


@pytest.mark.parametrize(("noise", "pushed"), [(1e-3, 0.0), (1e-5, 0.3)])
def test_a_velocity_beside_a_command_needs_no_richer_model(noise, pushed, tmp_path):
    """Each model is fitted to what it makes of the samples itself, and where these tell of it."""
    recording, theta, delay_s = tacho_of_one_mass(tmp_path / "tacho.npz", noise, pushed)
    begun = begin(recording, "auto", Options(delay_s=delay_s))
    assert begun.fit.model.name == "rigid" and begun.fit.reduced_chi_square < 1.3
    assert np.all(np.abs(begun.fit.theta - theta) < 4 * begun.fit.sd)
    assert begun.etfe.band_hz[1] <= 0.3 / PERIOD_S


def test_no_rows_are_missing_where_friction_turns_a_velocity(tmp_path):
    """Where it does, the integral bends by more than the sensor's noise, and none was lost."""
    mass, friction, steps, late = 0.3, 0.16, 10, 3
    rng = np.random.default_rng(9)
    force = 1.6 * rng.standard_normal(8000)
    kept, speed, speeds = 1 - 2.0 / mass * PERIOD_S / steps, 0.0, np.zeros(8000)
    for row, before in enumerate([0.0, *force[:-1]]):
        speeds[row] = speed
        for step in range(steps):
            push = before if step < late else force[row]
            free = speed * kept + push / mass * PERIOD_S / steps
            most = friction / mass * PERIOD_S / steps
            speed = free - min(max(free, -most), most)
    noise = 7e-4 * np.std(speeds) * rng.standard_normal(8000)
    recording = tacho(tmp_path / "tacho.npz", force, speeds + noise)
    begun = begin(recording, "rigid", Options(delay_s=late / steps * PERIOD_S))
    tests = {test.name: test for test in measurement_tests(begun.fit, begun.etfe)}
    assert not tests["dropped_samples"].flagged


def test_the_limit_from_a_tachometer_beside_a_command(tmp_path):
    """A rigid device: 5 % too low before what is between the samples was taken off."""
    mass, damping, delay_s = 0.4, 2.0, 4e-4
    rng = np.random.default_rng(6)
    force = rng.standard_normal(12000)
    gains, keep = gains_of_one_mass(mass, damping, delay_s)
    speed = lfilter(gains, [1.0, -keep], force)
    speed += 1e-3 * np.std(speed) * rng.standard_normal(12000)
    recording = tacho(tmp_path / "tacho.npz", force, speed)
    model = bh.rigid(delay_s=delay_s, period_s=PERIOD_S)
    true = bh.critical_stiffness(model, np.array([mass, damping])).value
    closed = bh.close_loop(recording, "rigid", delay_s=delay_s, held=False, hidden=False)
    assert closed.verdict == "consistent"
    low, high = (closed.analysis.limit.quantile(p) for p in (0.005, 0.995))
    assert low < true < high and high / low < 1.1
