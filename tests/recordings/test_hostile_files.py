"""Whatever is in a file, it is read as it was meant or refused in one line (property-based)."""

from __future__ import annotations

from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from every_format import WRITERS, mapping_of
from hypothesis import HealthCheck, given, settings, strategies as st

from bayeshaptic.devices import load_device
from bayeshaptic.errors import InputError
from bayeshaptic.recordings import read_recording, read_study
from bayeshaptic.recordings.readers import read_arrays, reader_for

few = settings(
    max_examples=25,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
numbers = st.floats(-1e9, 1e9, allow_nan=False, width=32).map(lambda x: float(f"{x:.6g}"))
DAMAGE = st.lists(st.tuples(st.floats(0, 0.999), st.integers(0, 255)), min_size=1, max_size=20)


@few
@given(
    rows=st.lists(st.tuples(numbers, numbers, numbers), min_size=2, max_size=8),
    separator=st.sampled_from([",", ";", "\t", " "]),
    comma=st.booleans(),
    preamble=st.lists(st.sampled_from(["Setup", "made by: me", "# remark"]), max_size=2),
    units=st.booleans(),
    encoding=st.sampled_from(["utf-8", "utf-8-sig", "utf-16"]),
)
def test_a_table_is_read_as_it_was_written(
    tmp_path: Path,
    rows: list[tuple[float, float, float]],
    separator: str,
    comma: bool,
    preamble: list[str],
    units: bool,
    encoding: str,
) -> None:
    lines = [*preamble, separator.join(["t", "u", "q"])]
    if units:
        lines.append(separator.join(["ms", "N", "mm"]))
    for row in rows:
        text = separator.join(map(repr, row))
        lines.append(text.replace(".", ",") if comma and separator != "," else text)
    path = tmp_path / "a.csv"
    path.write_text("\n".join([*lines, ""]), encoding=encoding)
    recording = read_recording(path, "force=u,position=q", period_s=1e-3)
    _, force, position = np.array(rows).T
    np.testing.assert_array_equal(recording.force, force)
    np.testing.assert_allclose(recording.position, position * (1e-3 if units else 1), rtol=1e-14)


@few
@given(
    start=st.datetimes(datetime(2000, 1, 1), datetime(2060, 1, 1)),
    form=st.sampled_from(["%d.%m.%Y %H:%M:%S.%f", "%Y-%m-%dT%H:%M:%S.%fZ", "%I:%M:%S.%f %p"]),
    missing=st.sets(st.integers(0, 19), max_size=5),
    empty=st.sampled_from(["", "NA", "n/a", "-", "null", "NaN"]),
)
def test_clock_times_and_empty_fields(
    tmp_path: Path, start: datetime, form: str, missing: set[int], empty: str
) -> None:
    """Over midnight and noon, too."""
    stamps = [(start + timedelta(milliseconds=10 * i)).strftime(form) for i in range(20)]
    rows = [f"{t},{i + 0.5},{empty if i in missing else i}" for i, t in enumerate(stamps)]
    path = tmp_path / "a.csv"
    path.write_text("\n".join(["t,u,q", *rows, ""]), encoding="utf-8")
    found = read_arrays(path)
    np.testing.assert_allclose(np.diff(found["t"]), 0.01, atol=1e-9)
    assert found["u"].tolist() == [i + 0.5 for i in range(20)]
    assert set(np.flatnonzero(np.isnan(found["q"]))) == missing


def damaged(content: bytes, damage: list[tuple[float, int]], cut: float) -> bytes:
    """`content` with some bytes changed and its end cut off."""
    changed = bytearray(content)
    for place, byte in damage:
        changed[int(place * len(changed))] = byte
    return bytes(changed[: max(int(cut * len(changed)), 1)])


IN_PROCESS = [name for name in WRITERS if not reader_for(Path(name)).apart]


@pytest.mark.parametrize("name", WRITERS)
def test_a_damaged_file_is_read_or_refused(tmp_path: Path, name: str) -> None:
    WRITERS[name](tmp_path / name)
    content = (tmp_path / name).read_bytes()

    @settings(few, max_examples=60 if name in IN_PROCESS else 2)
    @given(damage=DAMAGE, cut=st.sampled_from([1.0, 1.0, 0.9, 0.3]))
    def check(damage: list[tuple[float, int]], cut: float) -> None:
        (tmp_path / name).write_bytes(damaged(content, damage, cut))
        try:
            recording = read_recording(tmp_path / name, mapping_of(name))
        except InputError as error:
            assert name in str(error)
        else:
            assert np.isfinite(recording.force).all()

    check()


@pytest.mark.parametrize("read", [read_study, load_device])
def test_a_damaged_toml_file_is_read_or_refused(tmp_path: Path, read: object) -> None:
    (tmp_path / "a.csv").write_text("time_s,force_n,position_m\n", encoding="utf-8")
    text = "[device]\nname='lhifam'\ndelay_s=1e-4\n[[recording]]\nfile='a.csv'\nlevel=1.5\n"
    if read is load_device:
        text = "kind='rotational'\nband_hz=[1, 200]\nnotes=['x']\n[free]\nm1=1.5\nb1=0\n"
    path = tmp_path / "a.toml"

    @few
    @given(damage=DAMAGE, cut=st.sampled_from([1.0, 0.9, 0.5]))
    def check(damage: list[tuple[float, int]], cut: float) -> None:
        path.write_bytes(damaged(text.encode(), damage, cut))
        try:
            read(path)
        except InputError as error:
            assert "a.toml" in str(error) or "unknown device" in str(error)

    check()
