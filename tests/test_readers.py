"""Files of every format become recordings, and what is wrong with one is said in one line."""

from __future__ import annotations

import gzip
import math
import os
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from bayeshaptic.errors import InputError
from bayeshaptic.recordings import (
    Reader,
    Recording,
    read_frf,
    read_measurement,
    read_recording,
    recording_from_arrays,
    register_reader,
)
from bayeshaptic.recordings import readers as registry
from bayeshaptic.recordings.columns import parse_columns

MEASURED = Path(
    os.environ.get("BAYESHAPTIC_MEASURED", Path(__file__).parents[2] / "shared" / "measured")
)
N = 50
TIME = np.arange(N) * 1e-3
FORCE = np.random.default_rng(0).normal(size=N)
POSITION = 1e-3 * np.random.default_rng(1).normal(size=N)
SIGNALS = {"t": TIME, "u": FORCE, "q": POSITION}
MAPPING = "time=t,force=u,position=q"


def write_csv(path: Path, header: str = "t,u,q") -> None:
    np.savetxt(
        path, np.column_stack(list(SIGNALS.values())), header=header, comments="", delimiter=","
    )


def write_mat5(path: Path) -> None:
    from scipy.io import savemat

    extra = {"note": "text", "cell": np.array([1, "a"], dtype=object), "empty": np.zeros((0, 0))}
    savemat(path, {**{k: v[:, None] for k, v in SIGNALS.items()}, **extra})


def write_mat73(path: Path) -> None:
    import h5py

    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in SIGNALS.items():
            file.create_dataset(name, data=values[None, :]).attrs["MATLAB_class"] = np.bytes_(
                "double"
            )
        text = file.create_dataset("note", data=np.array([[116], [120]], dtype=np.uint16))
        text.attrs["MATLAB_class"] = np.bytes_("char")
        empty = file.create_dataset("empty", data=np.zeros(2, dtype=np.uint64))
        empty.attrs["MATLAB_empty"] = np.uint8(1)
        file.create_group("#refs#")["a"] = np.arange(3.0)
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(512, b" "))


def write_hdf5(path: Path) -> None:
    import h5py

    with h5py.File(path, "w") as file:
        for name, values in SIGNALS.items():
            file[name] = values
        file["note"] = "text"


def write_npz(path: Path) -> None:
    np.savez(path, **SIGNALS, note=np.array(["text"]), thing=np.array([None]))


# A new reader is tested by adding its file name and a writer here.
WRITERS: dict[str, Callable[[Path], None]] = {
    "a.csv": write_csv,
    "a.mat": write_mat5,
    "b.mat": write_mat73,
    "a.h5": write_hdf5,
    "a.npz": write_npz,
}


def assert_is_the_recording(recording: Recording) -> None:
    np.testing.assert_allclose(recording.force, FORCE, rtol=1e-15)
    np.testing.assert_allclose(recording.position, POSITION, rtol=1e-15)
    assert recording.period_s == 1e-3
    assert recording.time_jitter == 0


@pytest.mark.parametrize("name", WRITERS)
def test_every_format(tmp_path: Path, name: str) -> None:
    WRITERS[name](tmp_path / name)
    recording = read_recording(tmp_path / name, MAPPING)
    assert_is_the_recording(recording)
    assert recording.name == name[0]
    assert recording.source == tmp_path / name
    assert (recording.force_unit, recording.position_unit) == ("N", "m")


@pytest.mark.parametrize("name", WRITERS)
def test_an_array_that_is_not_there(tmp_path: Path, name: str) -> None:
    WRITERS[name](tmp_path / name)
    with pytest.raises(InputError, match=r"no column 'v' for the force; the file has .* \(50\)"):
        read_recording(tmp_path / name, "time=t,force=v,position=q")


@pytest.mark.parametrize("name", WRITERS)
def test_damaged_and_empty_files(tmp_path: Path, name: str) -> None:
    WRITERS[name](tmp_path / name)
    content = (tmp_path / name).read_bytes()
    for damaged in (b"", content[: len(content) // 2], b"\0\1\2\3" * 300):
        (tmp_path / name).write_bytes(damaged)
        with pytest.raises(InputError, match=re.escape(str(tmp_path / name))):
            read_recording(tmp_path / name, MAPPING)


def test_default_headers(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    for header, units in {
        "time_s,force_n,position_m": ("N", "m"),
        "time_s,torque_nm,angle_rad": ("Nm", "rad"),
        "time_s,current_a,angle_rad": ("A", "rad"),
    }.items():
        write_csv(path, header)
        recording = read_recording(path)
        assert (recording.force_unit, recording.position_unit) == units
        assert recording.notices == ()


DIALECTS = {
    "plain": "time_s,force_n,position_m\n0,1.5,2\n0.001,-2.5,3\n0.002,1e1,4\n",
    "windows": "\ufefftime_s,force_n,position_m\r\n0,1.5,2\r\n0.001,-2.5,3\r\n0.002,1e1,4\r\n",
    "comments": "# by me\n\ntime_s,force_n,position_m\n0,1.5,2\n0.001,-2.5,3\n# x\n0.002,10,4\n",
    "semicolon": "time_s;force_n;position_m\n0;1.5;2\n0.001;-2.5;3\n0.002;1e1;4\n",
    "comma": "time_s;force_n;position_m\n0;1,5;2\n0,001;-2,5;3\n0,002;1e1;4\n",
    "tab": "time_s\tforce_n\tposition_m\n0\t1.5\t2\n0.001\t-2.5\t3\n0.002\t1e1\t4\n",
    "blanks": "time_s  force_n position_m\n0   1.5  2\n 0.001 -2.5 3\n0.002  1e1  4\n",
    "spaces": "time_s, force_n, position_m\n0, 1.5, 2\n0.001, -2.5, 3\n0.002, 1e1, 4\n",
    "quotes": '"time_s","force_n","position_m"\n"0","1.5","2"\n0.001,-2.5,3\n0.002,1e1,4\n',
    "last": "time_s,force_n,position_m\n0,1.5,2,\n0.001,-2.5,3,\n0.002,1e1,4,\n",
    "text": "time_s,phase,force_n,position_m\n0,up,1.5,2\n0.001,up,-2.5,3\n0.002,,1e1,4\n",
}


@pytest.mark.parametrize("name", DIALECTS)
@pytest.mark.parametrize("packed", [False, True])
def test_dialects_of_csv(tmp_path: Path, name: str, packed: bool) -> None:
    content = DIALECTS[name].encode("utf-8")
    path = tmp_path / ("a.csv.gz" if packed else "a.csv")
    path.write_bytes(gzip.compress(content) if packed else content)
    recording = read_recording(path)
    assert recording.name == "a"
    assert recording.period_s == 1e-3
    assert recording.force.tolist() == [1.5, -2.5, 10.0]
    assert recording.position.tolist() == [2.0, 3.0, 4.0]


def test_columns_without_a_header(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("0 1.5 2\n1 -2.5 3\n2 10 4\n", encoding="utf-8")
    recording = read_recording(tmp_path / "a.txt", "time=1[ms],force=2*2,position=3[mm]")
    assert recording.period_s == 1e-3
    assert recording.force.tolist() == [3.0, -5.0, 20.0]
    np.testing.assert_allclose(recording.position, [2e-3, 3e-3, 4e-3])


WRONG_CSV = {
    "": "the file is empty",
    "\n\n# only a comment\n": "the file is empty",
    "time_s,force_n,position_m\n": "a header .* but no rows",
    "time_s,force_n,position_m\n0,1,2\n0.001,x,3\n": "'force_n': 'x' is not a number in row 2",
    "time_s,force_n,position_m\n0,1,2\n0.001,,3\n": "'force_n': there is no number in row 2",
    "time_s,force_n,position_m\n0,1,2\n0.001,1\n": "line 3 has 2 fields where 3 are expected",
    "time_s,force_n\n0,1\n0.001,2\n": r"no column for the position \(position_m or angle_rad\)",
    "time_s,force_n,force_n\n0,1,2\n": "'force_n' more than once",
    "time_s,force_n,torque_nm,position_m\n0,1,2,3\n": "both force_n and torque_nm",
    "time_s,force_n,position_m\n0,1,2\n0.001,nan,3\n0.002,1,1\n": r"force is nan in row 2 \(1 such",
    "time_s,force_n,position_m\n0,1,2\n0.001,1,inf\n0.002,1,1\n": "position is inf in row 2",
    "force_n,position_m\n1,2\n1,3\n0,2\n": "no column for the time.*or give the sampling period",
}


@pytest.mark.parametrize("content", WRONG_CSV)
def test_wrong_csv_says_where(tmp_path: Path, content: str) -> None:
    path = tmp_path / "a.csv"
    path.write_text(content, encoding="utf-8")
    with pytest.raises(InputError, match=WRONG_CSV[content]) as caught:
        read_recording(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    for path, message in (
        (tmp_path / "none.csv", "no such file"),
        (tmp_path, "a folder"),
        (tmp_path / "a.xlsx", r"no reader for files ending in '.xlsx'; known endings: .csv"),
    ):
        if path.suffix == ".xlsx":
            path.write_bytes(b"x")
        with pytest.raises(InputError, match=message):
            read_recording(path)
    (tmp_path / "a.csv").write_bytes(b"\x00\x01binary")
    with pytest.raises(InputError, match="not a text file"):
        read_recording(tmp_path / "a.csv")
    (tmp_path / "a.csv.gz").write_bytes(gzip.compress(b"time_s,force_n" * 99)[:-9])
    with pytest.raises(InputError, match="cannot be unpacked"):
        read_recording(tmp_path / "a.csv.gz")


def test_a_reader_of_ones_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry, "_registry", list(registry._registry))
    register_reader(Reader("mine", (".mine",), lambda path: dict(SIGNALS)))
    (tmp_path / "a.mine").write_text("x", encoding="utf-8")
    assert_is_the_recording(read_recording(tmp_path / "a.mine", MAPPING))


def test_matrices_structures_and_groups(tmp_path: Path) -> None:
    import h5py
    from scipy.io import savemat

    matrix = np.column_stack(list(SIGNALS.values()))
    savemat(tmp_path / "a.mat", {"data": matrix, "log": {"X": {"u": FORCE}, "q": POSITION}})
    assert_is_the_recording(
        read_recording(tmp_path / "a.mat", "time=data.1,force=data.2,position=data.3")
    )
    assert_is_the_recording(
        read_recording(tmp_path / "a.mat", "time=data.1,force=log.X.u,position=log.q")
    )
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["run/1"], file["run/u"], file["rows"] = TIME, FORCE, matrix.T
    # 'run/1' is a name here, not a division.
    assert_is_the_recording(
        read_recording(tmp_path / "a.h5", "time=run/1,force=run/u,position=rows/3")
    )


def test_the_measured_mat_file_with_objects() -> None:
    path = MEASURED / "two_mass_bench" / "MultisineTypeA.mat"
    if not path.exists():
        pytest.skip(f"measured recording not found: {path} (set BAYESHAPTIC_MEASURED)")
    recording = read_recording(path, "time=time*1e-6,force=iq_refx[A],position=theta_mx[rad]")
    assert recording.samples == 50_000
    assert recording.period_s == 4e-4
    assert recording.stiffness_unit == "A/rad"
    assert recording.force[0] == 12.97525
    with pytest.raises(InputError, match=r"the file has iq_adx \(50000\)"):
        read_recording(path)


def test_the_measured_servo() -> None:
    path = MEASURED / "emps" / "DATA_EMPS.mat"
    if not path.exists():
        pytest.skip(f"measured recording not found: {path} (set BAYESHAPTIC_MEASURED)")
    recording = read_recording(path, "time=t,force=vir*35.15[N],position=qm[m]")
    assert recording.samples == 24_841
    assert recording.period_s == 1e-3
    assert recording.force[0] == pytest.approx(35.15 * 2.53862809)


COLUMN_TERMS = {
    "u": ("u", 1.0, None),
    "u*35.15[N]": ("u", 35.15, "N"),
    "u * -1": ("u", -1.0, None),
    "u/1e3 [mm]": ("u", 1e-3, "mm"),
    "u[rad]": ("u", 1.0, "rad"),
    "a b*2": ("a b", 2.0, None),
    "a/b*.5": ("a/b", 0.5, None),
}


@pytest.mark.parametrize("term", COLUMN_TERMS)
def test_terms_of_the_mapping(term: str) -> None:
    column = parse_columns(f"force={term}")["force"]
    name, factor, unit = COLUMN_TERMS[term]
    assert (column.names[-1], column.unit) == (name, unit)
    assert column.factors[-1] == pytest.approx(factor)


WRONG_COLUMNS = {
    "forse=u": r"'forse' is none of time, force.*did you mean 'force'",
    "u": "'u' is none of",
    "force": "'force' has no name",
    "force=u,force=v": "'force' is given twice",
    "force=u*0": "other than zero",
    "force=u,position=q[inch],time=t": "'inch' is no unit of position: use m, mm",
    "force=u[V],position=q,time=t": "multiply other units by the force constant",
    "force=u,position=qq,time=t": "did you mean 'q'",
}


@pytest.mark.parametrize("columns", WRONG_COLUMNS)
def test_wrong_mappings(tmp_path: Path, columns: str) -> None:
    write_csv(tmp_path / "a.csv")
    with pytest.raises(InputError, match=WRONG_COLUMNS[columns]):
        read_recording(tmp_path / "a.csv", columns)


def test_units_and_what_they_are_taken_to_be(tmp_path: Path) -> None:
    write_csv(tmp_path / "a.csv")

    def units(columns: str, kind: str | None = None) -> tuple[str, str]:
        recording = read_recording(tmp_path / "a.csv", columns, kind=kind)
        return recording.force_unit, recording.position_unit

    assert units(MAPPING) == ("N", "m")
    assert units(MAPPING, "rotational") == ("Nm", "rad")
    assert units("time=t,force=u,position=q[deg]") == ("Nm", "rad")
    assert units("time=t,force=u[N m],position=q") == ("Nm", "rad")
    assert units("time=t,force=u[A],position=q") == ("A", "m")
    (note,) = read_recording(tmp_path / "a.csv", MAPPING).notices
    assert note.level == "note"
    assert "taken to be in N, the position in m" in note.text
    turned = read_recording(tmp_path / "a.csv", {"time": "t", "force": "u", "position": "q[deg]"})
    np.testing.assert_allclose(turned.position, POSITION * math.pi / 180)


def test_arrays_in_memory() -> None:
    recording = recording_from_arrays(FORCE[:, None], POSITION[None, :], period_s=2e-3)
    np.testing.assert_array_equal(recording.force, FORCE)
    assert recording.period_s == 2e-3
    assert recording.time_jitter is None
    with pytest.raises(ValueError, match="read-only"):
        recording.force[0] = 1.0
    for arguments, message in (
        ({"force": FORCE[1:], "period_s": 1e-3}, "force has 49, position has 50"),
        ({"force": [], "period_s": 1e-3}, r"not an array of shape \(0,\)"),
        ({"force": np.ones((2, N)), "period_s": 1e-3}, r"not an array of shape \(2, 50\)"),
        ({"period_s": 0.0}, "the period must be a number of seconds above 0"),
        ({}, "no time and no period"),
        ({"period_s": 1e-3, "force_unit": "lbf"}, "force_unit is 'lbf'; use N, Nm, A"),
        ({"period_s": 1e-3, "encoder_resolution": -1.0}, "encoder_resolution must be above 0"),
    ):
        with pytest.raises(InputError, match=message):
            recording_from_arrays(**{"force": FORCE, "position": POSITION, **arguments})


def test_a_recording_or_a_frequency_response(tmp_path: Path) -> None:
    write_csv(tmp_path / "a.csv", "u,v,position_m")
    found = read_measurement(
        tmp_path / "a.csv", "force=v", default_period_s=5e-4, encoder_resolution=1e-6
    )
    assert isinstance(found, Recording)
    assert found.period_s == 5e-4
    assert found.encoder_resolution == 1e-6
    write_csv(tmp_path / "b.csv", "time_s,force_n,position_m")
    found = read_measurement(tmp_path / "b.csv", default_period_s=5e-4)
    assert isinstance(found, Recording)
    assert found.period_s == 1e-3
    (tmp_path / "c.csv").write_text(
        "frequency_hz,gain_db,phase_deg,sd\n1,2,3,4\n", encoding="utf-8"
    )
    with pytest.raises(InputError, match="1 rows; a model needs"):
        read_measurement(tmp_path / "c.csv", period_s=1e-3)
    with pytest.raises(InputError, match="use read_frf"):
        read_recording(tmp_path / "c.csv")
    with pytest.raises(InputError, match="'force' belongs to a recording"):
        read_frf(tmp_path / "c.csv", 1e-3, "force=u")
