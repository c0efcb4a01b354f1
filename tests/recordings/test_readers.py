"""Files of every format become recordings, and what is wrong with one is said in one line."""

from __future__ import annotations

import gzip
import io
import re
import struct
import zipfile
import zlib
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from csv_signals import FORCE, MAPPING, POSITION, SIGNALS, TIME, N, write_csv
from every_format import WRITERS, mapping_of, write_mat5
from scipy.signal import lfilter

from bayeshaptic.errors import InputError
from bayeshaptic.faq import explained
from bayeshaptic.recordings import (
    Reader,
    Recording,
    read_frf,
    read_measurement,
    read_recording,
    readers as registry,
    recording_from_arrays,
    register_reader,
)
from bayeshaptic.recordings.readers import apart
from bayeshaptic.recordings.readers.matlab_sizes import refuse_sizes


def assert_is_the_recording(recording: Recording) -> None:
    np.testing.assert_allclose(recording.force, FORCE, rtol=1e-15)
    np.testing.assert_allclose(recording.position, POSITION, rtol=1e-15)
    assert recording.period_s == 1e-3
    assert recording.time_jitter == 0


@pytest.mark.parametrize("name", WRITERS)
def test_every_format(tmp_path: Path, name: str) -> None:
    WRITERS[name](tmp_path / name)
    recording = read_recording(tmp_path / name, mapping_of(name))
    assert_is_the_recording(recording)
    assert recording.name == name.split(".")[0]
    assert recording.source == tmp_path / name
    assert (recording.force_unit, recording.position_unit) == ("N", "m")


@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_process_apart_reads_whatever_its_output_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, unbuffered: str
) -> None:
    monkeypatch.setenv("PYTHONUNBUFFERED", unbuffered)
    WRITERS["a.mat"](tmp_path / "a.mat")
    assert_is_the_recording(read_recording(tmp_path / "a.mat", mapping_of("a.mat")))


@pytest.mark.parametrize("name", WRITERS)
def test_an_array_that_is_not_there(tmp_path: Path, name: str) -> None:
    WRITERS[name](tmp_path / name)
    with pytest.raises(
        InputError, match=r"no column 'none.* for the force.*; the file has .* \(50\)"
    ):
        read_recording(tmp_path / name, mapping_of(name).replace(",force=", ",force=none."))


@pytest.mark.parametrize("name", WRITERS)
def test_damaged_and_empty_files(tmp_path: Path, name: str) -> None:
    WRITERS[name](tmp_path / name)
    content = (tmp_path / name).read_bytes()
    for damaged in (b"", content[: len(content) // 2], b"\0\1\2\3" * 300):
        (tmp_path / name).write_bytes(damaged)
        with pytest.raises(InputError, match=re.escape(str(tmp_path / name))):
            read_recording(tmp_path / name, mapping_of(name))


def element(kind: int, content: bytes, claims: int | None = None) -> bytes:
    """A data element of a MAT file, version 5, as long as it is or as it `claims`."""
    size = len(content) if claims is None else claims
    return struct.pack("<II", kind, size) + content + bytes(-len(content) % 8)


def matrix(kind: int, rows: int, content: bytes = b"") -> bytes:
    head = element(6, struct.pack("<II", kind, 0)) + element(5, struct.pack("<ii", rows, 1))
    return element(14, head + element(1, b"") + content)


CLAIMS = {
    "claims 2147483647 numbers": matrix(4, 2**31 - 1, element(4, b"")),  # a text
    "claims 320000000 bytes where at most 0": matrix(1, 40_000_000),  # a cell
    "claims 4294967280 bytes where at most 8": matrix(6, 1, element(9, bytes(8), 2**32 - 16)),
}


@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize("claim", CLAIMS)
def test_sizes_are_looked_at_before_memory_is_taken(
    tmp_path: Path, claim: str, packed: bool
) -> None:
    """Claims of a MAT file at any depth: here of what is in a cell."""
    content = matrix(1, 1, CLAIMS[claim])
    if packed:
        content = element(15, zlib.compress(content))
    path = tmp_path / "a.mat"
    head = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H", 256) + b"IM"
    path.write_bytes(head + content)
    with pytest.raises(InputError, match=claim):
        refuse_sizes(path)
    with pytest.raises(InputError, match=claim):
        read_recording(path, MAPPING)


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
    "declared": "sep=;\ntime_s;force_n;position_m\n0;1,5;2\n0,001;-2,5;3\n0,002;1e1;4\n",
    "remark": "# made by me\n# time_s, force_n, position_m\n0,1.5,2\n0.001,-2.5,3\n0.002,1e1,4\n",
    "percent": "% time_s force_n position_m\n0 1.5 2\n0.001 -2.5 3\n0.002 1e1 4\n",
    "preamble": "Export of\tMonday\nOperator;A;B\n\ntime_s;force_n;position_m\n0;1,5;2\n"
    "0,001;-2,5;3\n0,002;1e1;4\n",
    "quoted commas": 'time_s,force_n,position_m\n"0","1,5","2"\n"0,001","-2,5","3"\n'
    '"0,002","10",4\n',
    "units": "Time (ms),Force [N],Position (mm)\n0,1.5,2000\n1,-2.5,3000\n2,1e1,4000\n",
    "unit row": "Setup 3\nt;load;Time;Force;Position\n-;Nm;ms;N;mm\n1;1;0;1,5;2000\n"
    "1;1;1;-2,5;3000\n1;1;2;1e1;4000\n",
    "missing": "time_s,force_n,position_m,other\n0,1.5,2,\n0.001,-2.5,3,NA\n0.002,1e1,4,7\n",
    "clock": "time_s,force_n,position_m\n20.11.2026 23:59:59.999,1.5,2\n"
    "21.11.2026 0:00:00,-2.5,3\n21.11.2026 0:00:00.001,1e1,4\n",
    "12 h": "time_s;force_n;position_m\n12:59:59,999 PM;1,5;2\n1:00:00,000 PM;-2,5;3\n"
    "1:00:00,001 PM;10;4\n",
    "hour": "time_s,force_n,position_m\n59:59.999,1.5,2\n00:00.000,-2.5,3\n00:00.001,1e1,4\n",
    "durations": "Time,Force,Position (m)\n0 sec,1.5 N,2\n0.001 sec,-2.5 N,3\n0.002 sec,10 N,4\n",
    "empty row": "Time;Force;Position\nms;N;mm\n;;\n0;1,5;2000\n1;-2,5;3000\n2;1e1;4000\n",
    "waveform": "waveform,[0],[1]\ndelta t,0.001,0.001\n\ntime_s,force_n,position_m\n"
    "2026-11-20T10:11:12.100Z,1.5,2\n2026-11-20T10:11:12.101Z,-2.5,3\n"
    "2026-11-20T10:11:12.102Z,1e1,4\n",
    "text": "time_s,phase,force_n,position_m\n0,up,1.5,2\n0.001,up,-2.5,3\n0.002,,1e1,4\n",
}


@pytest.mark.parametrize("name", DIALECTS)
@pytest.mark.parametrize("packed", [False, True])
def test_dialects_of_csv(tmp_path: Path, name: str, packed: bool) -> None:
    content = DIALECTS[name].encode("utf-16" if name in ("tab", "preamble") else "utf-8")
    path = tmp_path / ("a.csv.gz" if packed else "a.csv")
    path.write_bytes(gzip.compress(content) if packed else content)
    recording = read_recording(path)
    assert recording.name == "a"
    assert recording.period_s == 1e-3
    assert recording.force.tolist() == [1.5, -2.5, 10.0]
    assert recording.position.tolist() == [2.0, 3.0, 4.0]


THOUSANDS = {
    "semicolon": "t;u;q\n0.000;0.181;-976,414\n0.001;0.2;-5.2\n0.002;1.5;1,034.2\n",
    "quoted": 't,u,q\n0.000,0.181,"-976,414"\n0.001,0.2,12\n0.002,1.5,"1,034"\n',
    "no decimals": "t;u;q\n0;181;-976,414\n1;5;12\n2;8;3\n",
    "millions": "t;u;q\n0;181;1,976,414\n1;5;2,000,000\n2;8;3,000,000\n",
}


@pytest.mark.parametrize("name", THOUSANDS)
def test_commas_between_thousands_are_no_decimal_ones(tmp_path: Path, name: str) -> None:
    path = tmp_path / "a.csv"
    path.write_text(THOUSANDS[name], encoding="utf-8")
    with pytest.raises(InputError, match="'q': thousands separators .* in row 1; write the num"):
        read_recording(path, "time=t,force=u,position=q[um]")


def test_points_between_thousands_are_shown_as_they_stand(tmp_path: Path) -> None:
    """The message had the file's decimal comma as a second point: "'-1.080.16' in row 3"."""
    path = tmp_path / "a.csv"
    path.write_text("t;u;q\n0,000;0,5;-5,25\n0,001;1,5;12,5\n0,002;0,5;-1.080,16\n")
    with pytest.raises(InputError, match=r"'q': thousands separators \('-1.080,16'\) in row 3"):
        read_recording(path, "time=t,force=u,position=q[um]")


def test_two_topics_in_one_table_are_no_rows_with_both(tmp_path: Path) -> None:
    """As a bag of messages is written out: it was told to fill in 1500 rows."""
    path = tmp_path / "bag.csv"
    rows = [f"{k},{k % 7}.5,\n{k}.05,,{k % 5}\n" for k in range(1500)]
    path.write_text("t_ms,cmd,pos\n" + "".join(rows), encoding="utf-8")
    with pytest.raises(
        InputError, match="no row has both .*1500 rows have the one, 1500"
    ) as raised:
        read_recording(path, "time=t_ms,force=cmd[N],position=pos[mm]")
    assert "explain rows" in explained(raised.value)


def test_text_in_a_column_is_explained_as_a_row(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("time_s,force_n,position_m\n0,1,2\n0.001,ERR,3\n0.002,2,1\n")
    with pytest.raises(InputError, match="'ERR' is not a number in row 2") as raised:
        read_recording(path)
    assert "explain rows" in explained(raised.value)


def test_points_and_commas_are_no_one_decimal_sign(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("t;u;q\n0;0,5;1.234\n1;1,5;2.345\n", encoding="utf-8")
    with pytest.raises(InputError, match="'0,5' is not a number in row 1; write all with one dec"):
        read_recording(path, "time=t,force=u,position=q[mm]")


@pytest.mark.parametrize(
    "text",
    [
        "t;u;q\n0,000;0,181;-976,414\n0,001;0,5;12,125\n0,002;5;3\n",
        't,u,q\n"0,000","0,181","-976,414"\n"0,001","0,5","12,125"\n"0,002",5,3\n',
        "t;u;q\n1.2.2026 0:00:00,000;0,181;-976,414\n1.2.2026 0:00:00,001;0,5;12,125\n"
        "1.2.2026 0:00:00,002;5;3\n",
        "t u q\n0,000 0,181 -976,414\n0,001 0,5 12,125\n0,002 5 3\n",
    ],
)
def test_three_decimals_behind_commas_are_decimals(tmp_path: Path, text: str) -> None:
    path = tmp_path / "a.csv"
    path.write_text(text, encoding="utf-8")
    recording = read_recording(path, "time=t,force=u,position=q[m]")
    assert recording.force.tolist() == [0.181, 0.5, 5.0]
    assert recording.position.tolist() == [-976.414, 12.125, 3.0]


def test_bars_and_compound_data_sets(tmp_path: Path) -> None:
    import h5py

    table = np.column_stack(list(SIGNALS.values()))
    np.savetxt(tmp_path / "a.csv", table, delimiter="|", header="t|u|q", comments="")
    compound = np.zeros(N, dtype=[(name, float) for name in SIGNALS])
    for name, values in SIGNALS.items():
        compound[name] = values
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["run"] = compound
    for name, within in (("a.csv", ""), ("a.h5", "run/")):
        columns = f"time={within}t,force={within}u,position={within}q"
        np.testing.assert_allclose(read_recording(tmp_path / name, columns).position, POSITION)


def test_arrays_of_no_real_numbers_are_named(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    np.savez(path, t=TIME, u=FORCE + 0j, q=POSITION, o=np.array(list(FORCE), dtype=object))
    for name in "uo":
        with pytest.raises(InputError, match=f"'{name}' is there, but holds no real numbers"):
            read_recording(path, f"time=t,force={name},position=q")
    np.savez(path, o=np.array(list(FORCE), dtype=object))
    with pytest.raises(InputError, match="no vectors of numbers"):
        read_recording(path)


def test_dates_and_durations_of_numpy_are_seconds(tmp_path: Path) -> None:
    """As pandas has them."""
    path = tmp_path / "a.npz"
    since = np.round(1e9 * TIME).astype("timedelta64[ns]")
    for clock in (since, np.datetime64("2026-11-20T23:59:59.9") + since):
        np.savez(path, t=clock, u=FORCE, q=POSITION)
        recording = read_recording(path, "time=t,force=u[N],position=q[m]")
        assert recording.period_s == pytest.approx(TIME[1] - TIME[0], rel=1e-6)


def test_columns_without_a_header(tmp_path: Path) -> None:
    (tmp_path / "y.csv").write_text("t,Y[0],Y[1]\n0,1.5,2\n1,-2.5,3\n2,1e1,4\n", encoding="utf-8")
    recording = read_recording(tmp_path / "y.csv", "time=t,force=Y[0],position=Y[1][mm]")
    assert recording.force.tolist() == [1.5, -2.5, 10.0]
    np.testing.assert_allclose(recording.position, [2e-3, 3e-3, 4e-3])
    (tmp_path / "a.txt").write_text("0 1.5 2\n1 -2.5 3\n2 10 4\n", encoding="utf-8")
    recording = read_recording(tmp_path / "a.txt", "time=1[ms],force=2*2,position=3[mm]")
    assert recording.period_s == 1e-3
    assert recording.force.tolist() == [3.0, -5.0, 20.0]
    np.testing.assert_allclose(recording.position, [2e-3, 3e-3, 4e-3])


WRONG_CSV = {
    "": "the file is empty",
    "\n\n# only a comment\n": "the file is empty",
    "time_s,force_n,position_m\n": "a header .* but no rows",
    "time_s,force_n,position_m\n0,1,2\n0.001,1,2\na,b,c\n": "'b' is not a number in row 3",
    "time_s,force_n,position_m\n0,1,2\n0.001,x,3\n": "'force_n': 'x' is not a number in row 2",
    "time_s,force_n,position_m\n0,1,2\n0.001,,3\n": "force is nan in row 2 .*--rows 1:1",
    "time_s,force_n,position_m\n0,1,2\n0.001,1\n0.002,1,2\n": "line 3 has 2 fields where 3 are",
    "time_s,force_n,position_m\n0,1,2\n0.001,1,2\n0.002,2,1\n0": "line 5 has 1 field .*remove",
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
        (
            tmp_path / "a.xls",
            r"no reader for files ending in '.xls'; known endings: .csv .*table as .csv",
        ),
    ):
        if path.suffix == ".xls":
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


def test_the_measured_mat_file_with_objects(measured: Callable[[str], Path]) -> None:
    path = measured("two_mass_bench/MultisineTypeA.mat")
    recording = read_recording(path, "time=time*1e-6,force=iq_refx[A],position=theta_mx[rad]")
    assert recording.samples == 50_000
    assert recording.period_s == 4e-4
    assert recording.stiffness_unit == "A/rad"
    assert recording.force[0] == 12.97525
    with pytest.raises(InputError, match=r"the file has iq_adx \(50000\)"):
        read_recording(path)


def test_the_measured_servo(measured: Callable[[str], Path]) -> None:
    path = measured("emps/DATA_EMPS.mat")
    recording = read_recording(path, "time=t,force=vir*35.15[N],position=qm[m]")
    assert recording.samples == 24_841
    assert recording.period_s == 1e-3
    assert recording.force[0] == pytest.approx(35.15 * 2.53862809)


def test_arrays_in_other_units() -> None:
    degrees, counts = np.degrees(POSITION), np.degrees(1e-3)
    recording = recording_from_arrays(
        1e3 * FORCE, degrees, 1e-3, None, "mN m", "deg", encoder_resolution=counts
    )
    np.testing.assert_allclose(recording.force, FORCE, rtol=1e-14)
    np.testing.assert_allclose(recording.position, POSITION, rtol=1e-14)
    assert (recording.force_unit, recording.position_unit) == ("Nm", "rad")
    assert recording.encoder_resolution == pytest.approx(1e-3)
    with pytest.raises(ValueError, match="read-only"):
        recording.position[0] = 1.0


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
        ({"period_s": 0.0}, "period_s is 0.0; give a number above 0, in seconds"),
        ({}, "no time and no period"),
        (
            {"period_s": 1e-3, "force_unit": "lbf"},
            "force_unit: 'lbf' is no unit of force: use N, mN",
        ),
        ({"period_s": 1e-3, "kind": "rotary"}, "kind is 'rotary'; use translational or rotational"),
        (
            {"period_s": 1e-3, "kind": "rotational", "position_unit": "m"},
            r"translational by its units \(position in m\), but rotational as it was declared",
        ),
        (
            {"period_s": 1e-3, "kind": "translational", "force_unit": "Nm"},
            r"rotational by its units \(position in rad\), but translational as",
        ),
        (
            {"period_s": 1e-3, "force_unit": "Nm", "position_unit": "m"},
            "the force is in Nm and the position in m; give both in N and m",
        ),
        (
            {"period_s": 1e-3, "force": np.ma.array(FORCE, mask=np.arange(N) == 6)},
            r"force is nan in row 7 \(1 such row\)",
        ),
        (
            {"period_s": 1e-3, "encoder_resolution": -1.0},
            "encoder_resolution is -1.0; give a number above 0",
        ),
    ):
        with pytest.raises(InputError, match=message):
            recording_from_arrays(**{"force": FORCE, "position": POSITION, **arguments})


def test_masked_arrays_without_a_mask_and_fractions_are_numbers() -> None:
    recording = recording_from_arrays(np.ma.array(FORCE), np.ma.arange(N), Fraction(1, 1000))
    assert recording.period_s == 1e-3 and type(recording.period_s) is float
    np.testing.assert_array_equal(recording.force, FORCE)


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


def test_an_hdf5_file_with_broken_links_units_and_a_loop(tmp_path: Path) -> None:
    import h5py

    path = tmp_path / "a.h5"
    (tmp_path / "other.h5").write_bytes(b"secret")
    with h5py.File(path, "w") as file:
        for name, values in SIGNALS.items():
            file[name] = values
        file["q"].attrs["units"] = "mm"
        file["gone"], file["away"] = h5py.SoftLink("/no"), h5py.ExternalLink("other.h5", "/x")
        file["run/loop"] = file.create_group("run")
    recording = read_recording(path, MAPPING)
    np.testing.assert_allclose(recording.position, 1e-3 * POSITION)


def test_sizes_are_checked_before_memory_is_taken(tmp_path: Path) -> None:
    import h5py

    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.create_dataset("t", shape=(10**12,), dtype="f8", chunks=(1000,))
    header = io.BytesIO()
    claim = {"descr": "<f8", "fortran_order": False, "shape": (10**12,)}
    np.lib.format.write_array_header_1_0(header, claim)
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        archive.writestr("t.npy", header.getvalue() + bytes(80))
    for name in ("a.h5", "a.npz"):
        with pytest.raises(InputError, match="claims 1000000000000 numbers"):
            read_recording(tmp_path / name, MAPPING)


def test_a_reader_that_crashes_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_mat5(tmp_path / "a.mat")
    monkeypatch.setattr(apart, "_COMMAND", "import os; os.abort()")
    with pytest.raises(InputError, match="not a readable MAT file: its reader gave up"):
        read_recording(tmp_path / "a.mat", MAPPING)


def test_pickles_are_not_opened(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", t=np.array([print], dtype=object))
    with pytest.raises(InputError, match="no vectors of numbers"):
        read_recording(tmp_path / "a.npz", MAPPING)


def test_a_part_of_a_recording(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    write_csv(path)
    part = read_recording(path, MAPPING, rows=(11, 20))
    np.testing.assert_allclose(part.force, FORCE[10:20])
    for seconds, expected in (((0.01, 0.0195), FORCE[10:20]), ((None, 4.9e-3), FORCE[:5])):
        np.testing.assert_allclose(read_recording(path, MAPPING, seconds=seconds).force, expected)
    columns = "force=u,position=q"
    part = read_recording(path, columns, period_s=2e-3, seconds=(0.019, None))
    np.testing.assert_allclose(part.force, FORCE[10:])
    with pytest.raises(InputError, match="nothing is left of its 50 rows"):
        read_recording(path, MAPPING, rows=(60, 70))


@pytest.mark.parametrize("low", [0.0, -np.pi])
def test_an_angle_that_begins_again_after_a_turn_is_counted_on(low: float) -> None:
    """A measured motor's angle in 0 to 360 degrees hardly answered to the force."""
    rng = np.random.default_rng(5)
    force = rng.normal(size=4000)
    angle = 1e-3 * np.cumsum(np.cumsum(force)) / 100 + 0.01 * np.arange(4000)
    within = (angle - low) % (2 * np.pi) + low
    read = recording_from_arrays(force, within, period_s=1e-3, position_unit="rad")
    np.testing.assert_allclose(read.position - read.position[0], angle - angle[0], atol=1e-9)
    assert any("jumps by a turn" in notice.text for notice in read.notices)
    with pytest.raises(InputError, match="from one end of its range to the other, by some 6"):
        recording_from_arrays(force, within, period_s=1e-3, position_unit="m")


@pytest.mark.parametrize("encoder_resolution", [None, 2e-6])
def test_a_counter_that_begins_again_is_counted_on(encoder_resolution: float | None) -> None:
    rng = np.random.default_rng(5)
    force = rng.normal(size=4000)
    rows = np.arange(4000)
    counts = np.round(4000 * np.sin(rows / 40) + 20 * rows + np.cumsum(force))
    within = 2e-6 * (counts % 2**16)
    read = recording_from_arrays(
        force,
        within,
        period_s=1e-3,
        position_unit="m",
        encoder_resolution=encoder_resolution,
    )
    moved = read.position - read.position[0]
    np.testing.assert_allclose(moved, 2e-6 * (counts - counts[0]), atol=1e-12)
    assert any("a counter of 16 bits" in notice.text for notice in read.notices)


def test_a_position_with_a_new_zero_is_counted_on() -> None:
    """Its response "hardly answered to the force"."""
    rng = np.random.default_rng(8)
    force = rng.normal(size=4000)
    smooth = np.cumsum(np.cumsum(force - np.mean(force))) / 500
    for count in (0.0, 1e-4):
        way = count * np.round(smooth / count) if count else smooth
        jumps = way.copy()
        jumps[900:] += 5.0
        jumps[2500:] -= 60.0
        read = recording_from_arrays(force, jumps, period_s=1e-3, position_unit="m")
        (told,) = [notice for notice in read.notices if notice.topic == "jumps"]
        assert "jumps 2 times, the first time at row 901" in told.text
        assert "--rows 901:2500" in told.text
        # A step of each is not known: what the motion did beside it stands in its place.
        assert np.abs(read.position - way).max() < 2 * np.abs(np.diff(way, 2)).max() + 2 * count


@pytest.mark.parametrize("flickers", [False, True])
def test_a_standstill_while_the_force_goes_on_is_left_out(flickers: bool) -> None:
    """It was taken for feedback."""
    rng = np.random.default_rng(3)
    force = rng.normal(size=9000)
    moves = force * (np.arange(9000) >= 1000) * (np.arange(9000) < 8500)
    velocity = lfilter([1e-5], [1, -0.9], moves)
    velocity[8500:] = 0.0
    position = 1e-6 * (np.round(np.cumsum(velocity) / 1e-6))
    if flickers:
        position[:1000] += 1e-6 * (rng.random(1000) < 0.02)
    read = recording_from_arrays(force, position, period_s=1e-3, position_unit="m")
    (told,) = [notice for notice in read.notices if notice.topic == "standstill"]
    assert abs(read.samples - 7500) < 10
    assert "rows 1 to 100" in told.text and " to 9000 while" in told.text
    begin = int(np.flatnonzero(force == read.force[0])[0])
    assert np.array_equal(read.position, position[begin : begin + read.samples])
    # Without force, or where it rests elsewhere, too, a device merely rests.
    rests = np.where((np.arange(9000) // 1500) % 2 == 0, 0.0, position)
    share = np.arange(9000) / 9000
    sweep = np.sin(9000 * share**3)
    slow = 1e-6 * np.round(40 * sweep * (share < 0.9))
    for drive, kept in ((moves, position), (force, rests), (sweep, slow)):
        read = recording_from_arrays(drive, kept, period_s=1e-3, position_unit="m")
        assert read.samples == 9000


def test_a_position_that_does_not_jump_is_as_it_was() -> None:
    """A reading that falls out, few counts, a device that is struck, and one that often rests."""
    rng = np.random.default_rng(8)
    force, way = rng.normal(size=2000), np.cumsum(rng.normal(size=2000))
    fallen, rows = way.copy(), np.arange(2000)
    fallen[700] = -9 * np.ptp(way)
    few = np.round(np.sin(rows / 50))
    struck = np.cumsum(0.01 * rng.normal(size=2000) + 5.0 * (rows > 800) * np.exp(-rows / 300))
    rests = np.cumsum((rows % 40 == 0) * rng.normal(size=2000))
    for kept in (fallen, few, struck, rests):
        read = recording_from_arrays(force, kept, period_s=1e-3, position_unit="m")
        np.testing.assert_array_equal(read.position, kept)


def test_an_angle_that_does_not_begin_again_is_as_it_was() -> None:
    """A motion of several turns, and readings that fall out."""
    rng = np.random.default_rng(6)
    force, angle = rng.normal(size=2000), 5 + 0.001 * np.cumsum(rng.normal(size=2000))
    fallen = angle.copy()
    fallen[700] = 0.0
    far = angle + 0.01 * np.arange(2000)
    for kept in (angle, fallen, far):
        read = recording_from_arrays(force, kept, period_s=1e-3, position_unit="rad")
        np.testing.assert_array_equal(read.position, kept)
