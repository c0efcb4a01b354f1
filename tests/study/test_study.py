"""Studies: one device and all its recordings from a TOML file."""

from __future__ import annotations

import gzip
import re
import shutil
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from bayeshaptic.devices import load_device
from bayeshaptic.errors import InputError
from bayeshaptic.models.prior_table import _FORMS
from bayeshaptic.recordings import Recording, read_study
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.recordings.study import StudyEntry
from bayeshaptic.recordings.study_file import PRIOR_KEYS
from bayeshaptic.study.analysed import names_of
from bayeshaptic.study.analysis import analyse_study

SIGNALS = np.random.default_rng(0).normal(size=(30, 2))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with two recordings (one with names of its own) and a frequency response."""
    for name, header in (("a.csv", "force_n,position_m"), ("b.csv", "u,q")):
        np.savetxt(tmp_path / name, SIGNALS, header=header, comments="", delimiter=",")
    rows = "\n".join(f"{f},{-f},{-180},1e-6" for f in range(1, 20))
    (tmp_path / "frf.csv").write_text(
        f"frequency_hz,gain_db,phase_deg,sd\n{rows}\n", encoding="utf-8"
    )
    return tmp_path


def write(folder: Path, content: str) -> Path:
    path = folder / "study.toml"
    path.write_text(content, encoding="utf-8")
    return path


FULL = """
[device]
name = "my wheel"
kind = "translational"
period_s = 5e-4
delay_s = 1e-4
delay_sd_s = 1e-5
encoder_resolution = 1e-6
lever_m = 0.1
columns = "force=force_n[N],position=position_m[m]"

[prior]
m1 = { median = 0.2, log_sd = 0.3 }
b1 = { scale = 5 }
b2 = { scale = 5, floor = 5e-6 }
kc = { mean = 6e4, sd = 1e3 }
m2 = { low = 1, high = 9, log = true }

[[recording]]
file = "a.csv"
user = "Ada"
configuration = 0.3
trial = 2
level = 1.5

[[recording]]
file = "b.csv"
columns = { force = "u[N]", position = "q[mm]" }
configuration = "upright"
trial = "second"

[[recording]]
file = "frf.csv"
columns = "gain_db=gain_db[m/N]"
user = 3
"""


def test_a_full_study(folder: Path) -> None:
    study = read_study(write(folder, FULL))
    assert study.name == "study"
    assert study.device.name == "my wheel"
    assert (study.device.delay_s, study.device.delay_sd_s) == (1e-4, 1e-5)
    assert study.device.lever_m == 0.1
    assert study.users == ("Ada", "3")
    assert study.prior == {
        "m1": {"median": 0.2, "log_sd": 0.3},
        "b1": {"scale": 5.0},
        "b2": {"scale": 5.0, "floor": 5e-6},
        "kc": {"mean": 6e4, "sd": 1e3},
        "m2": {"low": 1.0, "high": 9.0, "log": True},
    }
    first, second, third = study.read_all()
    assert isinstance(first, Recording)
    assert (first.name, first.device, first.user) == ("a", "my wheel", "Ada")
    assert (first.configuration, first.trial, first.level) == (0.3, 2, 1.5)
    assert (first.period_s, first.encoder_resolution) == (5e-4, 1e-6)
    np.testing.assert_allclose(first.force, SIGNALS[:, 0])
    assert isinstance(second, Recording)
    assert (second.user, second.configuration, second.trial) == (None, "upright", "second")
    np.testing.assert_allclose(second.position, 1e-3 * SIGNALS[:, 1])
    assert isinstance(third, Etfe)
    assert third.period_s == 5e-4


RECORDING = "\n[[recording]]\nfile = 'a.csv'\n"


def test_a_known_device_with_parts_overridden(folder: Path) -> None:
    study = read_study(write(folder, f"[device]\nname = 'LHIfAM'\ndelay_s = 3e-4{RECORDING}"))
    lhifam = load_device("lhifam")
    assert study.device.delay_s == 3e-4
    assert study.device.parameters == lhifam.parameters
    assert study.device.encoder_resolution == lhifam.encoder_resolution
    content = f"[device]\nname = 'lhifam'\n[device.free]\nm1 = 1\n{RECORDING}"
    device = read_study(write(folder, content)).device
    assert device.parameters["free"] == {"m1": 1.0}
    assert device.parameters["grasped"] == lhifam.parameters["grasped"]


def test_a_device_file_beside_the_study(folder: Path) -> None:
    (folder / "mine.toml").write_text("kind = 'rotational'\nlever_m = 0.2\n", encoding="utf-8")
    study = read_study(write(folder, f"[device]\nfile = 'mine.toml'\n{RECORDING}"))
    assert (study.device.name, study.device.lever_m) == ("mine", 0.2)
    study = read_study(write(folder, f"[device]\nfile = 'mine.toml'\nname = 'x'\n{RECORDING}"))
    assert study.device.name == "x"


def test_units_follow_the_kind_of_device(folder: Path) -> None:
    columns = "columns = 'force=u,position=q'"
    content = f"[device]\nname='phantom'\n{columns}\n[[recording]]\nfile='b.csv'\n"
    (recording,) = read_study(write(folder, content)).read_all()
    assert recording.stiffness_unit == "N m/rad"


def test_a_name_that_is_almost_known(folder: Path) -> None:
    content = f"[device]\nname = 'lhifan'\nkind = 'translational'\n{RECORDING}"
    (note,) = read_study(write(folder, content)).notices
    assert "did you mean 'lhifam'" in note.text


DEVICE = "[device]\nname = 'lhifam'\n"
WRONG = {
    "": r"no \[device\] table",
    DEVICE: "no recordings",
    f"{DEVICE}[[recordings]]\nfile='a.csv'\n": r"unknown key 'recordings' \(did you mean 'reco",
    f"{DEVICE}[recording]\nfile='a.csv'\n": "no recordings",
    f"{DEVICE}[[recording]]\nfiel='a.csv'\n": r"recording 1 has an unknown key 'fiel' \(did you m",
    f"{DEVICE}{RECORDING}[[recording]]\nuser='x'\n": "recording 2 needs a file",
    f"{DEVICE}[[recording]]\nfile='none.csv'\n": "recording 1: no such file: .*none.csv",
    f"{DEVICE}[[recording]]\nfile=3\n": "recording 1: file must be text, not 3",
    f"{DEVICE}{RECORDING}level='high'\n": "recording 1: level must be a number, not 'high'",
    f"{DEVICE}{RECORDING}configuration=[1]\n": r"configuration must be a number, not \[1\]",
    f"{DEVICE}{RECORDING}user=true\n": "user must be text, not True",
    f"{DEVICE}{RECORDING}trial=1.5\n": "trial must be text, not 1.5",
    f"{DEVICE}{RECORDING}columns='forse=u'\n": "recording 1: columns: 'forse' is none of",
    f"{DEVICE}columns=3\n{RECORDING}": r"\[device\]: columns must be text like",
    f"{DEVICE}delay=1\n{RECORDING}": r"\[device\] has an unknown key 'delay' \(did you mean 'dela",
    f"{DEVICE}kind='rotational'\n{RECORDING}": "but the device lhifam is translational",
    f"[device]\nname='wheel'\n{RECORDING}": "no device 'wheel' is known: there are lhifam, phantom",
    f"[device]\ndelay_s=1e-4\n{RECORDING}": r"\[device\] needs a kind",
    f"[device]\nfile='none.toml'\n{RECORDING}": "no such file: .*none.toml",
    f"device=3\n{RECORDING}": r"\[device\] must be a table",
    f"{DEVICE}[prior]\nm1=3\n{RECORDING}": r"\[prior\], m1 must be a table",
    f"{DEVICE}[prior]\nm1={{men=3}}\n{RECORDING}": r"unknown key 'men' \(did you mean 'mean'\?\)",
    f"{DEVICE}[prior]\nm1={{scale='x'}}\n{RECORDING}": "m1: scale must be a number, not 'x'",
    f"{DEVICE}[prior]\nm1={{low=1,high=2,log=1}}\n{RECORDING}": "log must be true or false, not 1",
    "[device\n": "not valid TOML",
    f"{DEVICE}{RECORDING}rows=[0, 5]\n": "recording 1: rows are counted from 1 .*, and 0 is none",
    f"{DEVICE}{RECORDING}rows=[1.5, 9]\n": "rows are counted from 1 .*, and 1.5 is none",
    f"{DEVICE}{RECORDING}rows=[1, 9]\nseconds=[0, 1]\n": "both rows and seconds are given",
    f"{DEVICE}{RECORDING}{RECORDING}": r"recording 2: a\.csv is recording 1 already, and would",
    f"{DEVICE}columns='force=u'\n{RECORDING}{RECORDING}columns='force=u'\n": "recording 1 already",
    f"{DEVICE}{RECORDING}user='A'\n{RECORDING}user='B'\n": "recording 2: a.csv is recording 1",
    f"{DEVICE}{RECORDING}rows=[1, 9]\n{RECORDING.replace('a.csv', './a.csv')}": "is recording 1",
    f"{DEVICE}{RECORDING}rows=[1, 9]\n{RECORDING}rows=[8, 20]\n": "is recording 1 already",
}


def test_a_device_without_a_name_has_the_study_s(folder: Path) -> None:
    path = write(folder, f"[device]\nkind='rotational'\n{RECORDING}")
    assert read_study(path).device.name == path.stem


@pytest.mark.parametrize("content", WRONG)
def test_wrong_studies_say_where(folder: Path, content: str) -> None:
    path = write(folder, content)
    with pytest.raises(InputError, match=WRONG[content]) as caught:
        read_study(path)
    assert str(folder) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_copy_of_a_recording_is_no_second_person(folder: Path) -> None:
    named = [f"[[recording]]\nfile='{name}.csv'\nuser='{name}'\n" for name in ("a", "of-a", "b")]
    shutil.copy(folder / "a.csv", folder / "of-a.csv")
    with pytest.raises(InputError, match=r"of-a\.csv is a copy of a\.csv, recording 1"):
        read_study(write(folder, DEVICE + "".join(named)))
    for name in ("of-a.csv", "a.csv"):
        packed = gzip.compress((folder / name).read_bytes(), mtime=len(name))
        (folder / "of-a.csv").write_bytes(packed)
        with pytest.raises(InputError, match=r"of-a\.csv is a copy of a\.csv, recording 1"):
            read_study(write(folder, DEVICE + "".join(named)))
        (folder / "of-a.csv").write_bytes(packed[:-9] + bytes(9))
        assert len(read_study(write(folder, DEVICE + "".join(named))).users) == 3
    parts = f"{named[0]}rows=[1, 9]\n{named[1]}rows=[10, 20]\n"
    assert len(read_study(write(folder, DEVICE + parts)).users) == 2
    assert len(read_study(write(folder, DEVICE + named[0] + named[2])).users) == 2


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ("[prior]\nmm1 = {median = 1, log_sd = 0.3}\n", "mm1.*did you mean 'm1'"),
        ("[effects]\nextra_dely = 0.2\n", "extra_dely.*did you mean 'extra_delay'"),
    ],
)
def test_a_misspelt_word_is_told_with_its_file(folder: Path, table: str, words: str) -> None:
    path = write(folder, DEVICE + table + RECORDING)
    with pytest.raises(InputError, match=f"{re.escape(str(path))}.*{words}"):
        analyse_study(read_study(path))


def test_parts_of_one_file_are_recordings_of_their_own(folder: Path) -> None:
    parts = ("seconds=[0, 1]", "seconds=[1, 2]", "columns='force=force_n,position=position_m*2'")
    text = "".join(f"{RECORDING}{part}\n" for part in parts)
    study = read_study(write(folder, f"pool = false\n{DEVICE}{text}"))
    assert len(study.entries) == 3


def test_every_form_of_a_prior_may_be_declared(folder: Path) -> None:
    for keys in _FORMS:
        table = ", ".join(f"{key} = 0.5" for key in sorted(keys))
        content = f"{DEVICE}[prior]\nb1 = {{ {table} }}\n{RECORDING}"
        assert set(read_study(write(folder, content)).prior["b1"]) == keys
    assert set(PRIOR_KEYS) == {"log"}.union(*_FORMS)


def test_no_study(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        read_study(tmp_path / "none.toml")
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="cannot be read as text .*save it as UTF-8"):
        read_study(tmp_path / "binary.toml")


REFERENCED = """
[device]
name = "phantom"
[[reference]]
label = "relay experiments"
critical_stiffness_db = [40.0, 20.0]
[[reference]]
label = "without a hand"
held = false
critical_stiffness = 13.0
[[recording]]
file = "a.csv"
"""


def test_limits_known_from_elsewhere(tmp_path):
    (tmp_path / "a.csv").write_text("")
    (tmp_path / "study.toml").write_text(REFERENCED)
    relay, free = read_study(tmp_path / "study.toml").references
    assert relay.label == "relay experiments" and relay.held
    assert relay.critical_stiffness == pytest.approx((100.0, 10.0))
    assert not free.held and free.critical_stiffness == (13.0,)


@pytest.mark.parametrize(
    ("old", "new", "part"),
    [
        ('label = "relay experiments"', "", "needs a label"),
        ("critical_stiffness = 13.0", "", "needs critical_stiffness or"),
        ("critical_stiffness = 13.0", "critical_stiffness = -1", "above zero"),
        ("critical_stiffness = 13.0", "critical_stiffness = ['x']", "a list of numbers"),
        ("critical_stiffness = 13.0", "critical_stifness = 13", "did you mean"),
        ("held = false", "held = 'no'", "true or false"),
        ("[[reference]]", "[[refrence]]", "unknown key 'refrence'"),
    ],
)
def test_references_that_cannot_be(tmp_path, old, new, part):
    (tmp_path / "a.csv").write_text("")
    (tmp_path / "study.toml").write_text(REFERENCED.replace(old, new))
    with pytest.raises(InputError, match=part):
        read_study(tmp_path / "study.toml")


def test_files_outside_the_folder_are_read_where_it_is_allowed(folder: Path) -> None:
    (folder / "in").mkdir()
    study = folder / "in" / "study.toml"
    study.write_text(f"{DEVICE}[[recording]]\nfile='../a.csv'\n", encoding="utf-8")
    with pytest.raises(InputError, match="recording 1: ../a.csv is outside .* --allow-outside"):
        read_study(study)
    assert len(read_study(study, allow_outside=True).entries) == 1


HOSTILE = {
    "a = " + "[" * 2000 + "]" * 2000: "not valid TOML|nested more than",
    "a = [[[[[[[[[1]]]]]]]]]": "nested more than 8 deep",
    "a." * 6000 + "b = 1": "a line of more than 10000 characters",
    "# no\n" * 300_000: "larger than 1000 kB",
    f"a = {'9' * 5000}": "not valid TOML",
    f"{DEVICE}delay_s = {'9' * 400}": "delay_s must be a number .*, not 999.*[.][.][.](\\n|$)",
}


@pytest.mark.parametrize("content", HOSTILE, ids=lambda content: content[:12])
def test_hostile_toml(folder: Path, content: str) -> None:
    with pytest.raises(InputError, match=HOSTILE[content]) as caught:
        read_study(write(folder, content))
    assert len(str(caught.value)) < 500


@pytest.mark.parametrize(
    ("files", "names"),
    [
        (("a.csv", "b.csv"), ["a", "b"]),
        (("x/a.csv", "y/a.csv"), ["a-1", "a-2"]),
        (("x/a.csv", "y/a.csv", "a-1.csv"), ["a-2", "a-3", "a-1"]),
        (("A.csv", "a.csv"), ["A-1", "a-2"]),  # one folder where capitals do not count
    ],
)
def test_no_two_recordings_have_one_name(files: Sequence[str], names: list[str]) -> None:
    assert names_of([StudyEntry(Path(file)) for file in files]) == names
