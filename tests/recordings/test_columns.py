"""Which columns of a file are read, and in which units."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from csv_signals import FORCE, MAPPING, POSITION, SIGNALS, write_csv

from bayeshaptic.errors import InputError
from bayeshaptic.recordings import read_recording
from bayeshaptic.recordings.columns import name_and_unit, parse_columns
from bayeshaptic.recordings.units import is_assumed


def test_a_force_that_is_called_volts(tmp_path: Path) -> None:
    write_csv(tmp_path / "a.csv", "t,u_V,q")
    mapping = "time=t,force=u_V{},position=q"
    notices = read_recording(tmp_path / "a.csv", mapping.format("")).notices
    assert [n.level for n in notices if "'u_V', says volts" in n.text] == ["warning"]
    for term in ("*0.3[N]", "*0.3", "[N]"):
        notices = read_recording(tmp_path / "a.csv", mapping.format(term)).notices
        assert not any(n.level == "warning" for n in notices)


@pytest.mark.parametrize("name", ["duty_percent", "pwm", "Effort (%)", "u_V"])
def test_what_drives_an_amplifier_is_no_force(tmp_path: Path, name: str) -> None:
    write_csv(tmp_path / "a.csv", f"t,{name},q")
    notices = read_recording(tmp_path / "a.csv", f"time=t,force={name}*1[N],position=q").notices
    assert not any(n.level == "warning" for n in notices)
    if "(" in name:
        with pytest.raises(InputError, match="'%' is no unit of force.*force constant"):
            read_recording(tmp_path / "a.csv", f"time=t,force={name},position=q")
        return
    (said,) = read_recording(tmp_path / "a.csv", f"time=t,force={name},position=q").notices[-1:]
    assert (said.level, said.topic, said.about) == ("warning", "units", ("force",))


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
    write_csv(tmp_path / "a.csv", "t,tau_cmd,theta")
    assert units("time=t,force=tau_cmd,position=theta") == ("Nm", "rad")
    assert units("time=t,force=tau_cmd,position=theta", "translational") == ("N", "m")
    write_csv(tmp_path / "a.csv", "t,force,theta")  # they contradict each other
    assert units("time=t,force=force,position=theta") == ("N", "m")
    write_csv(tmp_path / "a.csv")
    (note,) = read_recording(tmp_path / "a.csv", MAPPING).notices
    assert note.level == "note"
    assert "taken to be in N, the position in m" in note.text
    turned = read_recording(tmp_path / "a.csv", {"time": "t", "force": "u", "position": "q[deg]"})
    np.testing.assert_allclose(turned.position, POSITION * math.pi / 180)


@pytest.mark.parametrize(
    "columns",
    [
        "time=t,force=x[N],position=x[m]",
        "time=t,force=x*-3[N],position=x[mm]",
        "time=t,force=f,position=t",
        "force=position_m",
    ],
)
def test_one_column_is_one_thing(tmp_path: Path, columns: str) -> None:
    """The position that was its own force was said to be under feedback."""
    path, time = tmp_path / "a.npz", np.arange(2000) * 1e-3
    np.savez(path, t=time, time_s=1 * time, x=np.sin(time), f=np.cos(time), position_m=time**2)
    with pytest.raises(InputError, match="is given as the .* and as the position; name another"):
        read_recording(path, columns)


@pytest.mark.parametrize(
    ("time", "force", "position", "factors", "units"),
    [
        ("t_ms", "cmd_mNm", "theta_deg", (1e-3, 1e-3, np.pi / 180), ("Nm", "rad")),
        ("t", "u", "Angle_Deg", (1, 1, np.pi / 180), ("Nm", "rad")),
        ("t_s", "force_n", "x_um", (1, 1, 1e-6), ("N", "m")),
        ("t", "iq_A", "pos mm", (1, 1, 1e-3), ("A", "m")),
        ("t_us*1e-6", "iq_A*2", "x_mm*0.001", (1e-6, 2, 1e-3), ("N", "m")),
        ("t", "tau_m", "theta_m", (1, 1, 1), ("Nm", "rad")),  # of the motor
        ("t", "u_a", "Channel A", (1, 1, 1), ("N", "m")),
        ("t", "u", "theta_deg[mrad]", (1, 1, 1e-3), ("Nm", "rad")),
    ],
)
def test_a_name_that_ends_in_a_unit_is_read_in_it(
    tmp_path: Path,
    time: str,
    force: str,
    position: str,
    factors: tuple[float, ...],
    units: tuple[str, str],
) -> None:
    path = tmp_path / "a.csv"
    names = [name.split("*")[0].split("[")[0] for name in (time, force, position)]
    columns = np.column_stack([SIGNALS["t"] / factors[0], FORCE, POSITION])
    np.savetxt(path, columns, header=",".join(names), comments="", delimiter=",")
    recording = read_recording(path, f"time={time},force={force},position={position}")
    assert recording.period_s == pytest.approx(SIGNALS["t"][1] - SIGNALS["t"][0])
    np.testing.assert_allclose(recording.force, factors[1] * FORCE)
    np.testing.assert_allclose(recording.position, factors[2] * POSITION)
    assert (recording.force_unit, recording.position_unit) == units


def test_the_note_says_that_a_unit_is_by_the_name(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    write_csv(path, "t,u,theta_deg")
    assumed, note = read_recording(path, "time=t,force=u,position=theta_deg").notices
    assert "the position 'theta_deg' in deg" in note.text
    assert "The force's unit is not given: it is taken to be in Nm" in assumed.text
    assert not read_recording(path, "time=t,force=u[Nm],position=theta_deg[deg]").notices
    with pytest.raises(InputError, match=r"multiplied by 2; .* position=...\*2\[deg\]"):
        read_recording(path, "time=t,force=u,position=theta_deg*2")


@pytest.mark.parametrize(
    ("force", "position", "assumed"),
    [
        ("u", "q", ("force", "position")),
        ("u", "q[m]", ("force",)),
        ("u[N]", "q", ("position",)),
        ("u[A]", "q", ("position",)),
        ("u[N]", "q[mm]", ()),
    ],
)
def test_whatever_unit_nobody_said_is_noted(
    tmp_path: Path, force: str, position: str, assumed: tuple[str, ...]
) -> None:
    """A force in N beside millimetres that were taken for metres: nothing told."""
    write_csv(tmp_path / "a.csv", "t,u,q")
    recording = read_recording(tmp_path / "a.csv", f"time=t,force={force},position={position}")
    said = [what for what in ("force", "position") if is_assumed(what, recording.notices)]
    assert tuple(said) == assumed
    units = {"force": recording.force_unit, "position": recording.position_unit}
    if len(assumed) == 1:
        text = f"The {assumed[0]}'s unit is not given: it is taken to be in {units[assumed[0]]}."
        assert recording.notices[0].text.startswith(text)


def test_a_unit_in_the_middle_of_a_name(tmp_path: Path) -> None:
    header = "t [ms] rel,Force (kN) command,Position [mm] - axis 1"
    write_csv(tmp_path / "a.csv", header)
    time, force, position = header.split(",")
    for mapping in (
        f"time={time},force={force},position={position}",
        "time=t rel,force=Force command,position=Position - axis 1",
    ):
        recording = read_recording(tmp_path / "a.csv", mapping)
        assert recording.period_s == pytest.approx(1e-3 * (SIGNALS["t"][1] - SIGNALS["t"][0]))
        np.testing.assert_allclose(recording.force, 1e3 * FORCE)
        np.testing.assert_allclose(recording.position, 1e-3 * POSITION)
    assert name_and_unit("group/Position (mm)/time") == ("group/Position (mm)/time", None)


def test_units_in_headers(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    np.savetxt(
        path,
        np.column_stack(list(SIGNALS.values())),
        header="t,Force (kN),Position (mm)",
        comments="",
        delimiter=",",
    )
    for force in ("Force", "Force (kN)", "Force[kN]"):
        recording = read_recording(path, f"time=t,force={force},position=Position (mm)")
        np.testing.assert_allclose(recording.force, 1e3 * FORCE)
        np.testing.assert_allclose(recording.position, 1e-3 * POSITION)
    turned = read_recording(path, "time=t,force=Force*-1,position=Position[m]")
    np.testing.assert_allclose(turned.force, -1e3 * FORCE)
    np.testing.assert_allclose(turned.position, POSITION)
    with pytest.raises(InputError, match=r"multiplied by 2; write which unit that gives"):
        read_recording(path, "time=t,force=Force*2,position=Position")
    write_csv(path, "Time (s),Force (V),Position (mm)")
    with pytest.raises(InputError, match="'V' is no unit of force.*multiply"):
        read_recording(path)


def test_headers_are_known_in_any_case(tmp_path: Path) -> None:
    write_csv(tmp_path / "a.csv", "Time_s,Force_N,Position_M")
    write_csv(tmp_path / "b.csv", "time_s,force_n,position_m")
    upper, lower = (read_recording(tmp_path / name) for name in ("a.csv", "b.csv"))
    assert upper.force_unit == lower.force_unit == "N"
    assert np.array_equal(upper.position, lower.position)
    write_csv(tmp_path / "c.csv", "time_s,force_n,Force_N")
    with pytest.raises(InputError, match="both force_n and Force_N; say which"):
        read_recording(tmp_path / "c.csv")


@pytest.mark.parametrize(
    ("header", "units", "factors"),
    [
        ("time_ms,force_mN,position_mm", ("N", "m"), (1e-3, 1e-3, 1e-3)),
        ("time_s,force_Nm,position_rad", ("Nm", "rad"), (1.0, 1.0, 1.0)),
        ("t_us,torque_mNm,angle_deg", ("Nm", "rad"), (1e-6, 1e-3, math.pi / 180)),
    ],
)
def test_plain_words_that_end_in_a_unit_need_no_mapping(
    tmp_path: Path, header: str, units: tuple[str, str], factors: tuple[float, float, float]
) -> None:
    path = tmp_path / "a.csv"
    time = np.arange(len(FORCE)) / factors[0] * 1e-3
    signals = np.column_stack([time, FORCE, POSITION])
    np.savetxt(path, signals, delimiter=",", header=header, comments="")
    recording = read_recording(path)
    assert (recording.force_unit, recording.position_unit) == units
    np.testing.assert_allclose(recording.period_s, 1e-3)
    np.testing.assert_allclose(recording.force, FORCE * factors[1])
    np.testing.assert_allclose(recording.position, POSITION * factors[2])


def test_a_header_that_is_one_of_ours_comes_first(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    signals = np.column_stack([np.arange(len(FORCE)) * 1e-3, FORCE, POSITION, POSITION * 1e3])
    np.savetxt(
        path, signals, delimiter=",", header="time_s,force_n,position_m,position_mm", comments=""
    )
    np.testing.assert_allclose(read_recording(path).position, POSITION)
    signals = signals[:, [0, 1, 3, 3]]
    np.savetxt(
        path, signals, delimiter=",", header="time_s,force_n,position_mm,angle_deg", comments=""
    )
    with pytest.raises(InputError, match="both position_mm and angle_deg"):
        read_recording(path)
