"""Frequency responses from tables, and the variance that they imply."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bayeshaptic.devices import load_device
from bayeshaptic.diagnosis.base.begun import begin
from bayeshaptic.diagnosis.base.opened import opened
from bayeshaptic.diagnosis.options import Options
from bayeshaptic.errors import InputError
from bayeshaptic.models import free, rigid
from bayeshaptic.recordings import read_frf, read_measurement
from bayeshaptic.recordings.checks.check import check_table
from bayeshaptic.recordings.checks.units_in_doubt import in_doubt
from bayeshaptic.recordings.response.etfe import Etfe

FREQUENCY = np.linspace(2.0, 300.0, 40)
RESPONSE = 1 / (5.0 * (2j * np.pi * FREQUENCY) ** 2 + 7.0 * 2j * np.pi * FREQUENCY)
GAIN_DB, PHASE_DEG = 20 * np.log10(np.abs(RESPONSE)), np.degrees(np.angle(RESPONSE))


def write(path: Path, **columns: np.ndarray | float) -> Path:
    rows = np.shape(columns.get("frequency_hz", FREQUENCY))
    table = np.column_stack([np.broadcast_to(values, rows) for values in columns.values()])
    np.savetxt(path, table, header=",".join(columns), comments="", delimiter=",")
    return path


def base(**columns: np.ndarray | float) -> dict[str, np.ndarray | float]:
    return {"frequency_hz": FREQUENCY, "gain_db": GAIN_DB, "phase_deg": PHASE_DEG, **columns}


def test_a_table_with_standard_deviations(tmp_path: Path) -> None:
    sd = 0.01 * np.abs(RESPONSE)
    etfe = read_frf(write(tmp_path / "a.csv", **base(sd=sd)), period_s=1e-3)
    np.testing.assert_allclose(etfe.value, RESPONSE, rtol=1e-12)
    np.testing.assert_allclose(etfe.variance, sd**2, rtol=1e-12)
    np.testing.assert_allclose(etfe.gain_db, GAIN_DB)
    assert np.all(np.isnan(etfe.coherence))
    assert etfe.recording is None
    assert etfe.period_s == 1e-3
    assert etfe.band_hz == (2.0, 300.0)
    assert etfe.stiffness_unit == "N/m"
    (note,) = etfe.notices
    assert "m/N" in note.text
    # The likelihood of a known variance is Gaussian: log p = -|z - g|^2 / variance.
    windows = etfe.spectra.windows()
    off = windows.target[:, 0] + 2 * sd
    loss = (windows.lines - 1) * np.log1p(np.abs(windows.target[:, 0] - off) ** 2 / windows.scatter)
    np.testing.assert_allclose(loss, 4.0, rtol=1e-4)


def test_rows_in_any_order(tmp_path: Path) -> None:
    shuffled = np.random.default_rng(0).permutation(len(FREQUENCY))
    columns = {name: np.broadcast_to(v, 40)[shuffled] for name, v in base(sd=FREQUENCY).items()}
    etfe = read_frf(write(tmp_path / "a.csv", **columns), period_s=1e-3)
    np.testing.assert_allclose(etfe.frequency_hz, FREQUENCY)
    np.testing.assert_allclose(etfe.value, RESPONSE, rtol=1e-12)
    np.testing.assert_allclose(etfe.variance, FREQUENCY**2)


@pytest.mark.parametrize("averages", [4, 16])
def test_the_variance_that_coherence_implies(tmp_path: Path, averages: int) -> None:
    # Many tables of one response at 40 frequencies, each averaged from Gaussian segments: on
    # average the variance that each table states is the scatter that the tables show.
    rng = np.random.default_rng(averages)
    tables, noise = 2000, 0.5
    shape = (tables, averages, len(FREQUENCY))

    def gaussian() -> np.ndarray:
        return (rng.normal(size=shape) + 1j * rng.normal(size=shape)) / np.sqrt(2)

    force = gaussian()
    position = RESPONSE * force + noise * np.abs(RESPONSE) * gaussian()
    cross = (force.conj() * position).sum(axis=1)
    force_power = (np.abs(force) ** 2).sum(axis=1)
    coherence = np.abs(cross) ** 2 / (force_power * (np.abs(position) ** 2).sum(axis=1))
    estimate = cross / force_power
    stated = np.empty((20, len(FREQUENCY)))
    for row in range(20):
        columns = base(coherence=coherence[row], averages=averages)
        columns["gain_db"] = 20 * np.log10(np.abs(estimate[row]))
        columns["phase_deg"] = np.degrees(np.angle(estimate[row]))
        etfe = read_frf(write(tmp_path / "a.csv", **columns), period_s=1e-3)
        np.testing.assert_allclose(etfe.value, estimate[row], rtol=1e-12)
        np.testing.assert_allclose(etfe.coherence, coherence[row])
        assert np.all(etfe.spectra.windows().lines == averages)
        stated[row] = etfe.variance
    formula = np.abs(estimate) ** 2 * (1 - coherence) / (coherence * (averages - 1))
    np.testing.assert_allclose(stated, formula[:20], rtol=1e-10)
    error = np.abs(estimate - RESPONSE) ** 2
    # Both sides are means of 80000 draws whose relative sd is below 3 with four averages.
    assert formula.mean(axis=0).sum() / error.mean(axis=0).sum() == pytest.approx(1, abs=0.05)


def test_what_digits_leave_open_is_in_the_variance(tmp_path: Path) -> None:
    """A quiet table with two digits after the point: its scatter is that of the rounding."""
    rng = np.random.default_rng(7)
    gain_db, phase_deg = rng.uniform(-90, -40, 2000), rng.uniform(-180, 180, 2000)
    response = 10 ** (gain_db / 20) * np.exp(1j * np.radians(phase_deg))
    columns = {"frequency_hz": np.linspace(2.0, 300.0, 2000), "sd": 1e-7 * np.abs(response)}
    columns |= {"gain_db": np.round(gain_db, 2), "phase_deg": np.round(phase_deg, 1)}
    etfe = read_frf(write(tmp_path / "a.csv", **columns), period_s=1e-3, kind="rotational")
    pull = np.abs(etfe.value - response) ** 2 / etfe.variance
    assert pull.mean() == pytest.approx(1.0, abs=0.1)


def test_a_coherence_that_was_rounded_to_one(tmp_path: Path) -> None:
    """As analysers write it: half of its last digit is what may be missing."""
    coherence = np.where(np.arange(len(FREQUENCY)) < 9, 0.9997, 1.0)
    etfe = read_frf(write(tmp_path / "a.csv", **base(coherence=coherence, averages=9)), 1e-3)
    missing = np.where(coherence < 1, 3e-4, 5e-5)
    expected = np.abs(RESPONSE) ** 2 * missing / (1 - missing) / 8
    np.testing.assert_allclose(etfe.variance, expected)


def test_units(tmp_path: Path) -> None:
    path = write(tmp_path / "a.csv", **base(sd=1.0))
    for columns, kind, unit, factor in (
        ("gain_db=gain_db[rad/A]", None, "A/rad", 1.0),
        ("gain_db=gain_db[mm/N]", None, "N/m", 1e-3),
        (None, "rotational", "N m/rad", 1.0),
    ):
        etfe = read_frf(path, 1e-3, columns, kind=kind)
        assert etfe.stiffness_unit == unit
        np.testing.assert_allclose(etfe.value, factor * RESPONSE)
        np.testing.assert_allclose(etfe.variance, factor**2)
    assert read_frf(path, 1e-3, force_unit="A", position_unit="rad").notices == ()


def test_other_names_and_formats(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    np.savez(path, f=FREQUENCY, g=GAIN_DB, p=PHASE_DEG, c=np.full(40, 0.9), n=np.array(16))
    columns = "frequency=f,gain_db=g,phase_deg=p,coherence=c,averages=n"
    etfe = read_measurement(path, columns, default_period_s=1e-3)
    assert isinstance(etfe, Etfe)
    np.testing.assert_allclose(etfe.variance, np.abs(RESPONSE) ** 2 / 9 / 15)


def changed(values: np.ndarray | float, index: int, value: float) -> np.ndarray:
    column = np.broadcast_to(values, len(FREQUENCY)).astype(float)
    column[index] = value
    return column


WRONG: dict[str, dict[str, np.ndarray | float]] = {
    "needs its uncertainty, .*there is neither": base(),
    "there is coherence without averages": base(coherence=0.9),
    "sd is 0 at 2 Hz; it must be above 0": base(sd=changed(1, 0, 0)),
    "sd is nan in row 3": base(sd=changed(1, 2, np.nan)),
    "coherence is 1 at 2 Hz; it must be between 0 and 1": base(coherence=1.0, averages=9),
    "averages is 1 at 2 Hz; it must be at least 2": base(coherence=0.5, averages=1),
    "frequency 600 Hz is not above 0 and up to the Nyquist frequency, 500 Hz": base(sd=1)
    | {"frequency_hz": changed(FREQUENCY, 5, 600.0)},
    "frequency -1 Hz is not above 0": base(sd=1) | {"frequency_hz": changed(FREQUENCY, 0, -1.0)},
    "frequency 2 Hz is there twice": base(sd=1) | {"frequency_hz": changed(FREQUENCY, 1, 2.0)},
    "no column for the phase_deg": {"frequency_hz": FREQUENCY, "gain_db": GAIN_DB, "sd": 1.0},
}


@pytest.mark.parametrize("message", WRONG)
def test_tables_that_cannot_be_used(tmp_path: Path, message: str) -> None:
    path = write(tmp_path / "a.csv", **WRONG[message])
    with pytest.raises(InputError, match=message) as caught:
        read_frf(path, period_s=1e-3)
    assert "\n" not in str(caught.value)


def test_rows_that_tell_nothing_of_the_loop_are_left_out(tmp_path: Path) -> None:
    """A line at 0 Hz, whatever is in it; of a structure also what is above half the rate."""
    still = {"frequency_hz": np.r_[0.0, FREQUENCY], "sd": 1.0}
    columns = {"gain_db": np.r_[-np.inf, GAIN_DB], "phase_deg": np.r_[np.nan, PHASE_DEG]}
    etfe = read_frf(write(tmp_path / "a.csv", **still, **columns), 1e-3, kind="rotational")
    np.testing.assert_allclose(etfe.value, RESPONSE)
    assert any("1 at 0 Hz" in notice.text for notice in etfe.notices)
    beyond = base(sd=1.0) | {"frequency_hz": np.r_[FREQUENCY[:-2], 700.0, 900.0]}
    beyond["receptance_db"] = beyond.pop("gain_db")
    found = read_frf(write(tmp_path / "b.csv", **beyond), 1e-3, kind="rotational")
    assert len(found.value) == len(FREQUENCY) - 2
    assert any("2 above half the sampling rate, 500 Hz" in n.text for n in found.notices)


def test_a_table_needs_a_period(tmp_path: Path) -> None:
    path = write(tmp_path / "a.csv", **base(sd=1.0))
    with pytest.raises(InputError, match="give --period-s"):
        read_frf(path)
    with pytest.raises(InputError, match="above 0"):
        read_frf(path, -1.0)
    with pytest.raises(InputError, match="position over force"):
        read_frf(path, 1e-3, "gain_db=gain_db[m]")


@pytest.mark.parametrize(
    ("scale_db", "told"), [(0.0, None), (60.0, "0.001 kg"), (-60.0, "1e+03 kg")]
)
def test_a_table_of_a_device_that_cannot_be_is_a_slip_of_units(
    tmp_path: Path, scale_db: float, told: str | None
) -> None:
    lighter = 20 * np.log10(5.0) + scale_db  # of 1 kg, and in mm or km
    columns = base(sd=1e-2 * np.abs(RESPONSE) * 10 ** (lighter / 20)) | {
        "gain_db": GAIN_DB + lighter
    }
    table = read_frf(write(tmp_path / "a.csv", **columns), 1e-3, "gain_db=gain_db[m/N]")
    found = check_table(table)
    assert bool(found) == bool(told)
    for notice in found:
        assert f"answers as {told} would: a slip of units?" in notice.text
        assert in_doubt("position", found)
    with pytest.raises(InputError, match="position in m.*, but the device phantom is rotational"):
        check_table(table, load_device("phantom"))
    compared = check_table(table, load_device("lhifam"))
    assert bool(compared) == bool(told)


def test_a_table_that_is_noise_alone_says_nothing_of_units(tmp_path: Path) -> None:
    table = read_frf(write(tmp_path / "a.csv", **base(sd=9 * np.abs(RESPONSE))), 1e-3)
    assert check_table(table) == ()


def test_the_check_of_a_table_reaches_the_report(tmp_path: Path) -> None:
    columns = base(sd=1e-2 * np.abs(RESPONSE) * 1e4) | {"gain_db": GAIN_DB + 80}
    table = read_frf(write(tmp_path / "a.csv", **columns), 1e-3, "gain_db=gain_db[m/N]")
    found = opened(table, "rigid", Options(delay_s=0.0))
    assert in_doubt("position", found.notices)


@pytest.mark.parametrize(
    ("kind", "derivatives", "unit"),
    [("receptance_db", 0, "m/N"), ("mobility_db", 1, "m/s/N"), ("accelerance_db", 2, "mm/s^2/N")],
)
def test_the_response_of_a_structure_gets_the_hold(
    tmp_path: Path, kind: str, derivatives: int, unit: str
) -> None:
    """Beside the exact sampled response of the same mass and damper."""
    of = RESPONSE * (2j * np.pi * FREQUENCY) ** derivatives * (1e3 if unit[:2] == "mm" else 1)
    sd = 1e-3 * np.abs(of)
    gain, phase = 20 * np.log10(np.abs(of)), np.degrees(np.angle(of))
    columns = {"frequency_hz": FREQUENCY, kind: gain, "phase_deg": phase, "sd": sd}
    mapping = f"{kind}={kind}[{unit}]"
    etfe = read_frf(write(tmp_path / "a.csv", **columns), period_s=1e-3, columns=mapping)
    model = rigid(delay_s=0.0).with_period(1e-3)
    exact = model.response(np.array([5.0, 7.0]), FREQUENCY)
    assert np.all(np.abs(etfe.value - exact) < 2 * np.sqrt(etfe.variance))
    low = FREQUENCY < 30  # aliases are (30 / 970)^3 there
    np.testing.assert_allclose(etfe.value[low], exact[low], rtol=1e-4)
    np.testing.assert_allclose(np.sqrt(etfe.variance[low]), 1e-3 * abs(exact[low]), rtol=1e-3)
    assert any("structure" in note.text for note in etfe.notices)


def test_a_fitted_model_says_what_a_structure_has_above_half_the_sampling_rate(
    tmp_path: Path,
) -> None:
    """Two masses, up to 0.4 of the sampling rate: nothing else is needed to explain them."""
    model = free(delay_s=4e-4, period_s=1e-3)
    values = {"m1": 0.25, "b1": 0.5, "kc": 3e4, "bc": 3.0, "m2": 1.5, "b2": 4.0}
    theta = np.array([values[name] for name in model.names])
    frequency = np.arange(1.0, 400.0)
    mobility = model.system(theta).continuous_response(2j * np.pi * frequency)[0]
    mobility = mobility * 2j * np.pi * frequency
    rng = np.random.default_rng(5)
    noise = rng.standard_normal(399) + 1j * rng.standard_normal(399)
    seen = mobility * (1 + 0.01 / np.sqrt(2) * noise)
    columns = {"frequency_hz": frequency, "mobility_db": 20 * np.log10(np.abs(seen))}
    columns |= {"phase_deg": np.degrees(np.angle(seen)), "sd": 0.01 * np.abs(mobility)}
    table = read_frf(write(tmp_path / "a.csv", **columns), 1e-3, kind="translational")
    begun = begin(table, "auto", Options(delay_s=4e-4))
    assert begun.fit.model.name == "free" and begun.fit.reduced_chi_square < 1.2
    true = np.array([{**values, "force_lag_s": 0.0}[name] for name in begun.fit.model.names])
    off = (begun.fit.theta - true) / begun.fit.sd
    assert np.nanmax(np.abs(off)) < 4
    # What was measured is as exact as the table says, and what was added is right.
    exact = model.response(theta, frequency)
    held = begun.etfe.value - exact
    assert np.mean(np.abs(held) ** 2 / begun.etfe.variance) == pytest.approx(1, abs=0.2)
    assert begun.etfe.relative_sd[-1] < 0.02 < begun.measured.relative_sd[-1]


def test_a_response_is_of_one_kind(tmp_path: Path) -> None:
    both = write(tmp_path / "a.csv", **base(receptance_db=GAIN_DB, sd=0.1))
    with pytest.raises(InputError, match="there is gain_db and receptance_db"):
        read_frf(both, period_s=1e-3)
