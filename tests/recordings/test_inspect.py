"""``bayeshaptic inspect`` recognises columns, and what it suggests can be used."""

from __future__ import annotations

import os
import shlex
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from every_format import WRITERS, mapping_of

from bayeshaptic import cli
from bayeshaptic.commands.inspect import lines
from bayeshaptic.errors import InputError
from bayeshaptic.recordings import read_recording, read_study
from bayeshaptic.recordings.overview.overview import doubts, overview

N = 2000
RNG = np.random.default_rng(0)
FORCE = RNG.normal(size=N)
POSITION = np.round(np.cumsum(np.cumsum(FORCE - FORCE.mean()))) * 3e-6


def write(path: Path, header: str) -> Path:
    columns = (np.arange(N), FORCE, POSITION, np.gradient(POSITION))
    np.savetxt(path, np.column_stack(columns), header=header, comments="", delimiter=",")
    return path


@pytest.mark.parametrize("header", ["t,F_cmd,enc,velocity", "a,b,c,speed"])
def test_columns_are_recognised(tmp_path: Path, header: str) -> None:
    path = write(tmp_path / "a.csv", header)
    found = overview(path)
    time, force, position, _ = header.split(",")
    assert found.roles == {"time": time, "force": force, "position": position}
    facts = {one.name: one for one in found.columns}
    assert facts[time].period == 1
    assert facts[position].resolution == pytest.approx(3e-6)
    recording = read_recording(path, found.mapping)
    assert recording.period_s == 1e-3  # a step of one is a millisecond: no loop runs at 1 Hz
    np.testing.assert_allclose(recording.position, POSITION, rtol=1e-12)


@pytest.mark.parametrize(
    ("header", "words"),
    [
        ("t,tau,theta,v", "perhaps [rad] or [deg]"),
        ("t,dac_V,x,v", "volts? multiply by the force of one"),
        ("t,duty,x,v", "a duty cycle? multiply by the force of one"),
        ("t,F (V),x (mm),v", "in V: multiply by the force of one"),
        ("t,F,x (counts),v", "in counts: multiply by the size of one"),
    ],
)
def test_what_to_settle(tmp_path: Path, header: str, words: str) -> None:
    assert words in "\n".join(lines(overview(write(tmp_path / "a.csv", header))))


def test_a_velocity_is_no_position(tmp_path: Path) -> None:
    path = write(tmp_path / "a.csv", "t,Controller/u/In1,Encoder/x/Out1 (mm),Encoder/dx/Out1 (m/s)")
    assert overview(path).roles["position"] == "Encoder/x/Out1 (mm)"
    path = write(tmp_path / "b.csv", "t,F_cmd,Encoder/x/Out1,Encoder/dx/Out1")
    assert overview(path).roles["position"] == "Encoder/x/Out1"


def test_degrees_gaps_and_rows_that_are_there_twice(tmp_path: Path) -> None:
    angle = 0.0225 * np.round(POSITION / 3e-6)
    rows = [f"{t / 1e3},{u},{q:.4f}" for t, u, q in zip(range(N), FORCE, angle, strict=True)]
    rows[100] = rows[100].rpartition(",")[0] + ","
    rows[180:180] = rows[179:180] * 30
    path = tmp_path / "a.csv"
    path.write_text("\n".join(["t,torque,angle", *rows]), encoding="utf-8")
    found = overview(path)
    assert found.mapping == "force=torque,position=angle,time=t"
    assert "angle: 1 rows without a number" in "\n".join(lines(found))
    facts = replace(found.columns[2], missing=0)
    assert doubts(facts, "position") == "16,000 steps to 360: degrees? Write [deg] after the name"
    with pytest.raises(InputError, match="position is nan in row 101"):
        read_recording(path, found.mapping)


@pytest.mark.parametrize(
    ("header", "size", "line", "words"),
    [
        ("t,u,theta_deg", 1.3, "force=u,position=theta_deg[deg],time=t[ms]", "in deg by its name"),
        ("t_us,cmd_mNm,x_mm", 1.3, "force=cmd_mNm[mNm],position=x_mm[mm],time=t_us[us]", "in mm"),
        ("t,u,y", 1.3, "force=u,position=y[UNIT],time=t[ms]", "large for metres or radians"),
        ("t,u,y", 1.0, "force=u,position=y,time=t[ms]", "whole numbers: encoder counts?"),
        ("Sample,u,y", 1.0, "force=u,position=y,time=Sample[UNIT]", "the number of the sample?"),
    ],
)
def test_the_line_has_the_unit_or_asks_for_it(
    tmp_path: Path, header: str, size: float, line: str, words: str
) -> None:
    """What the numbers cannot be is not suggested: metres and radians of thousands."""
    path, study = tmp_path / "a.csv", tmp_path / "study.toml"
    columns = np.column_stack([np.arange(N), FORCE, size * np.round(POSITION / 3e-6)])
    np.savetxt(path, columns, header=header, comments="", delimiter=",")
    found = overview(path)
    assert found.mapping == line
    assert words in "\n".join(lines(found))
    assert cli.main(["inspect", str(path), "--write", str(study)]) == 0
    if "UNIT" in line:
        with pytest.raises(InputError, match="'UNIT' is no unit of (position|time): use"):
            read_recording(path, line)


def test_two_levels_are_no_counts_and_no_time_asks_for_the_period(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    for low, high, whole in ((1.837, 3.081, False), (-2.0, 3.0, True)):
        force = np.where(FORCE > 0, high, low)
        columns = np.column_stack([force, POSITION])
        np.savetxt(path, columns, header="u,y", comments="", delimiter=",")
        shown = lines(overview(path))
        assert ("converter counts?" in "\n".join(shown)) == whole
        assert shown[-1] == '--columns "force=u,position=y" --period-s SECONDS'


def test_a_time_in_ms_under_a_name_in_seconds_is_doubted(tmp_path: Path) -> None:
    for period, doubted in ((1.0, True), (1e-3, False)):
        columns = np.column_stack([np.arange(len(FORCE)) * period, FORCE, POSITION])
        np.savetxt(
            tmp_path / "a.csv",
            columns,
            header="time_s,force_n,position_m",
            comments="",
            delimiter=",",
        )
        shown = "\n".join(lines(overview(tmp_path / "a.csv")))
        words = "time: time_s: one sample every 1 s by its name, which no loop has: time=time_s[ms]"
        assert (words in shown) == doubted


def test_a_table_of_a_response_needs_no_columns(tmp_path: Path) -> None:
    frequency = np.linspace(1.0, 300.0, 60)
    columns = np.column_stack([frequency, -frequency, -frequency, np.ones(60)])
    np.savetxt(
        tmp_path / "a.csv",
        columns,
        header="frequency_hz,gain_db,phase_deg,sd",
        comments="",
        delimiter=",",
    )
    study = tmp_path / "study.toml"
    shown = lines(overview(tmp_path / "a.csv"))
    assert shown[-1].startswith("a table of a frequency response")
    assert not any("--columns" in line or line.endswith("?") for line in shown)
    assert cli.main(["inspect", str(tmp_path / "a.csv"), "--write", str(study)]) == 0
    assert "columns" not in study.read_text() and read_study(study).device.period_s == 1e-3


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write(tmp_path / "a.csv", "t,u,y,v\x1b[31m")
    study, picture = tmp_path / "study.toml", tmp_path / "a.png"
    command = ["inspect", str(path), "--write", str(study), "--png", str(picture)]
    assert cli.main(command) == 0
    out = capsys.readouterr().out
    assert '--columns "force=u,position=y,time=t[ms]"' in out
    assert "\x1b" not in out
    assert picture.read_bytes().startswith(b"\x89PNG")
    text = study.read_text(encoding="utf-8").replace('"my device"', '"phantom"')
    study.write_text(text.replace('"translational"', '"rotational"'), encoding="utf-8")
    (recording,) = read_study(study).read_all()
    assert recording.samples == N
    assert cli.main(command) == 2
    assert "--force" in capsys.readouterr().err


def test_excitations_of_the_bench(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for kind in ("chirp", "prbs", "step"):
        path = tmp_path / f"{kind}.npz"
        command = ["simulate", "lhifam", "--seconds", "2", "--force-rms", "2.5"]
        command += ["--excitation", kind, "-o", str(path)]
        assert cli.main(command) == 0
        force = read_recording(path).force
        assert np.sqrt(np.mean(force**2)) == pytest.approx(2.5, rel=0.05)
        assert (len(np.unique(force)) == 2) == (kind != "chirp")
    assert cli.main(command) == 2
    assert "exists; name another file, or overwrite it with --force" in capsys.readouterr().err
    assert cli.main([*command, "--force"]) == 0


def test_a_study_is_written_with_what_a_person_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """In a terminal the guess is asked about: a line each, empty for what is suggested."""
    rng = np.random.default_rng(1)
    table = np.column_stack([1e-3 * np.arange(99), rng.normal(size=(99, 2)).cumsum(axis=0)])
    np.savetxt(tmp_path / "a.csv", table, delimiter=",", header="t,iq,enc", comments="")
    answers = iter(["", "nothing", "iq[m]", "iq*2.1[Nm]", "iq", "enc*1e-6[rad]"])
    monkeypatch.setattr("sys.stdin.isatty", lambda: True)
    monkeypatch.setattr("sys.stdout.isatty", lambda: True, raising=False)
    monkeypatch.setattr("builtins.input", lambda _: next(answers))
    study = tmp_path / "s.toml"
    assert cli.main(["inspect", str(tmp_path / "a.csv"), "--write", str(study)]) == 0
    assert 'columns = "time=t,force=iq*2.1[Nm],position=enc*1e-6[rad]"' in study.read_text()
    out = capsys.readouterr().out
    for reply in ("no column 'nothing'", "'m' is no unit of force", "has a role already"):
        assert reply in out
    assert read_study(study).read_all()[0].kind == "rotational"  # as the units say
    study.unlink()
    monkeypatch.setattr("builtins.input", nobody)
    assert cli.main(["inspect", str(tmp_path / "a.csv"), "--write", str(study)]) == 2
    assert "nothing was written" in capsys.readouterr().err and not study.exists()


def nobody(_: str) -> str:
    raise EOFError


def test_the_line_survives_a_shell_and_stamps_may_jitter(tmp_path: Path) -> None:
    rng = np.random.default_rng(2)
    stamps = 1e-3 * (np.arange(N) + 0.2 * rng.normal(size=N))
    path = tmp_path / "a.npz"
    np.savez(path, **{"time": stamps, '"Root"/"$u"': FORCE, '"Root"/"theta"': POSITION})
    found = overview(path)
    assert found.roles["time"] == "time"
    words = shlex.split(lines(found)[-1])
    assert words == ["--columns", found.mapping]


@pytest.mark.parametrize("name", ["dspace.mat", "dspace73.mat"])
def test_signals_are_suggested_by_their_own_names(tmp_path: Path, name: str) -> None:
    WRITERS[name](tmp_path / name)
    found = overview(tmp_path / name)
    assert not {"rec.Y(1).Data", "rec.Y(2).Data"} & {one.name for one in found.columns}
    recording = read_recording(tmp_path / name, found.mapping)
    named = read_recording(tmp_path / name, mapping_of(name))
    assert {found.roles["force"][:1], found.roles["position"][:1]} == {"u", "q"}
    np.testing.assert_array_equal(recording.force, named.force)


@pytest.mark.parametrize(
    ("header", "roles"),
    [
        (
            "time_s,pwm,setpoint,angle",
            {"force": "pwm", "position": "angle", "reference": "setpoint"},
        ),
        ("t,target_pos,effort,position", {"force": "effort", "reference": "target_pos"}),
        ("t,motor_cmd,commanded_deg,feedback_deg", {"force": "motor_cmd"}),
        ("t,Target Torque,Target Pos,Position", {"force": "Target Torque", "position": "Position"}),
        ("t,iq_ref,error,theta", {"force": "iq_ref", "position": "theta"}),
    ],
)
def test_what_a_controller_followed_is_no_force(
    tmp_path: Path, header: str, roles: dict[str, str]
) -> None:
    """Names tell: a reference in degrees was suggested as the force, or as the position."""
    first, second = header.split(",")[1:3]
    rough = np.random.default_rng(3).normal(size=N)  # rougher than the force, as a reference may be
    signals = {roles["force"]: np.convolve(FORCE, [1, 1, 1], "same")}
    columns = [np.arange(N), signals.get(first, rough), signals.get(second, rough), POSITION]
    np.savetxt(
        tmp_path / "a.csv", np.column_stack(columns), header=header, comments="", delimiter=","
    )
    found = overview(tmp_path / "a.csv")
    assert roles.items() <= found.roles.items()
    assert found.mapping is not None
    assert "reference=" not in found.mapping
    shown = "\n".join(lines(found))
    assert ("Then add ,reference=" in shown) == ("reference" in found.roles)


def test_a_speed_alone_is_named_as_one(tmp_path: Path) -> None:
    """Beside it another signal is a position only where it goes as far as the speed says."""
    speed, volts = np.gradient(POSITION), 12 + 0.01 * RNG.normal(size=N).cumsum()
    for other, role in ((volts, "velocity"), (POSITION, "position")):
        columns = np.column_stack([np.arange(N), FORCE, other, speed])
        np.savetxt(
            tmp_path / "a.csv", columns, header="t,PWM,a,Speed (RPM)", comments="", delimiter=","
        )
        found = overview(tmp_path / "a.csv")
        assert role in found.roles and len(found.roles) == 3
    np.savetxt(
        tmp_path / "b.dat", np.column_stack([FORCE, speed]), header="torque rpm", comments="#"
    )
    shown = lines(overview(tmp_path / "b.dat"))
    assert shown[-1] == '--columns "force=torque,velocity=rpm[rpm]" --period-s SECONDS'
    np.savetxt(tmp_path / "c.csv", POSITION, header="angle", comments="")
    *_, missing, elsewhere = lines(overview(tmp_path / "c.csv"))
    assert missing == "no force was recognised; name them with --columns"
    assert elsewhere.startswith("a force that stands in another file: write both into one table")


def test_a_guess_is_called_so_and_a_clock_asked_for(tmp_path: Path) -> None:
    """Steps of a hundred are ten a second in ms and ten thousand in us."""
    path = tmp_path / "a.csv"
    columns = np.column_stack([100.0 * np.arange(N), FORCE, POSITION])
    np.savetxt(path, columns, delimiter=",")
    found = overview(path)
    shown = "\n".join(lines(found))
    assert "time: 1: 10 Hz in ms, 1e+04 Hz in us: write the unit after the name" in shown
    assert "force: 2: a guess, the roughest signal" in shown
    assert found.mapping == "force=2,position=3,time=1[UNIT]"
    with pytest.raises(InputError, match="'UNIT' is no unit of time"):
        read_recording(path, found.mapping)
    np.savetxt(path, columns, header="t (millisec),u,x", comments="", delimiter=",")
    assert read_recording(path, overview(path).mapping).period_s == pytest.approx(0.1)


def test_one_row_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a.csv").write_text("time_s,force_n,position_m\n1,2,3\n", encoding="utf-8")
    assert cli.main(["inspect", str(tmp_path / "a.csv")]) == 2
    assert "no column has more than one number" in capsys.readouterr().err


def test_the_recording_is_never_written_over(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write(tmp_path / "a.csv", "t,u,y,v")
    before = path.read_bytes()
    for option in ("--write", "--png"):
        assert cli.main(["inspect", str(path), option, str(path), "--force"]) == 2
        assert "is the recording itself" in capsys.readouterr().err
    assert path.read_bytes() == before


def test_a_study_names_files_of_any_letters(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """JSON writes a sign beyond 16 bits as two surrogates, which TOML does not know."""
    study = tmp_path / "study.toml"
    assert cli.main(["inspect", str(write(tmp_path / "\U0001f600.csv", "t,u,y,v"))]) == 0
    path = tmp_path / "\U0001f600.csv"
    assert cli.main(["inspect", str(path), "--write", str(study)]) == 0
    (recording,) = read_study(study).read_all()
    assert recording.samples == N
    if os.name == "nt" or sys.platform == "darwin":
        return  # where a name is never other than Unicode
    path = path.rename(tmp_path / os.fsdecode(b"caf\xe9.csv"))
    assert cli.main(["inspect", str(path), "--write", str(tmp_path / "b.toml")]) == 2
    assert "caf?.csv: a study cannot name what is no UTF-8" in capsys.readouterr().err
    assert not (tmp_path / "b.toml").exists()


def test_a_second_header_is_named(tmp_path: Path) -> None:
    """Several trials in one file: no column was recognised, and nothing said why."""
    path = tmp_path / "a.csv"
    rows = [f"{k},{u:.3f},{x:.7f}" for k, (u, x) in enumerate(zip(FORCE, POSITION, strict=True))]
    path.write_text("\n".join(["t,u,x", *rows, "t,u,x", *rows]), encoding="utf-8")
    assert f"t: 't' is not a number in row {N + 1}; mend or remove the row" in lines(overview(path))


def test_a_measured_force_is_no_command(tmp_path: Path) -> None:
    """A log of a motor has both, and the sensor's is the rougher."""
    header = "loop_time,motor_torque_command,motor_measured_torque,angle"
    rough = FORCE + np.random.default_rng(4).normal(size=N)
    columns = np.column_stack([1e-3 * np.arange(N), FORCE, rough, POSITION])
    path = tmp_path / "a.csv"
    np.savetxt(path, columns, header=header, comments="", delimiter=",")
    assert overview(path).roles["force"] == "motor_torque_command"
    np.savetxt(path, columns[:, [0, 2, 3]], header="t,torque_fb,angle", comments="", delimiter=",")
    assert "measured, not commanded? Then write measured_force=" in "\n".join(lines(overview(path)))


def test_the_range_of_a_long_recording_is_that_of_all_of_it(tmp_path: Path) -> None:
    """It was that of its first half million rows, and so was the number of those without one."""
    count = 600_000
    time, force = 1e-3 * np.arange(count), np.zeros(count)
    force[-3:] = 7.0, -5.0, np.nan
    np.savez(tmp_path / "long.npz", time_s=time, force_n=force, position_m=np.sin(time))
    facts = {one.name: one for one in overview(tmp_path / "long.npz").columns}
    assert facts["time_s"].high == time[-1] and facts["time_s"].samples == count
    assert (facts["force_n"].low, facts["force_n"].high) == (-5.0, 7.0)
    assert facts["force_n"].missing == 1


def test_a_study_of_a_recording_elsewhere_says_how_it_is_read(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write(tmp_path / "a.csv", "t,u,y,v")
    (tmp_path / "studies").mkdir()
    for study, said in ((tmp_path / "s.toml", False), (tmp_path / "studies" / "s.toml", True)):
        assert cli.main(["inspect", str(path), "--write", str(study)]) == 0
        assert ("--allow-outside" in capsys.readouterr().out) == said
