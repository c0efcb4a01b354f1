"""What cannot be used is refused in one line; what should be known is said."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter
from tiny_bench import PERIOD, SCALE, band_noise, record, relay

import bayeshaptic as bh
from bayeshaptic.devices import Device, load_device
from bayeshaptic.diagnosis.base.direct import opened_directly
from bayeshaptic.diagnosis.base.opened import opened
from bayeshaptic.diagnosis.options import Options
from bayeshaptic.errors import InputError, Notice
from bayeshaptic.recordings import Recording, check_recording, read_recording
from bayeshaptic.recordings.checks import what_drives_what
from bayeshaptic.recordings.checks.sufficiency import FEWEST_SAMPLES
from bayeshaptic.recordings.checks.units_in_doubt import in_doubt, normalised, steps_of_a_turn
from bayeshaptic.recordings.feedback import doubts, is_certain
from bayeshaptic.recordings.from_arrays import recording_from_arrays
from bayeshaptic.recordings.units import is_assumed


@cache
def held(device: str = "lhifam") -> Recording:
    """A sound recording of a device in a hand."""
    rng = np.random.default_rng(4)
    noise = SCALE[device]["rms"] * band_noise(rng, (1, 8000), 200.0)
    force, position = record(f"{device} grasped", noise, rng)
    units = {"lhifam": ("N", "m"), "phantom": ("Nm", "rad")}[device]
    return Recording(force[0], position[0], PERIOD, *units, name="held")


def changed(**parts: Any) -> Recording:
    return replace(held(), **parts)


def topics(notices: tuple[Notice, ...], level: str = "warning") -> list[str]:
    return [notice.topic for notice in notices if notice.level == level]


@pytest.mark.parametrize("device", SCALE)
def test_nothing_is_said_of_a_sound_recording(device: str) -> None:
    assert check_recording(held(device)) == ()
    assert check_recording(held(device), load_device(device)) == ()


def test_what_reading_found_is_kept() -> None:
    note = Notice("note", "units", "assumed")
    assert check_recording(changed(notices=(note,))) == (note,)


def with_value(signal: np.ndarray, index: int, value: float) -> np.ndarray:
    signal = signal.copy()
    signal[index] = value
    return signal


REFUSED = {
    r"50 samples \(0.05 s\) are too few: at least 1000 \(1 s at this period\)": held().part(0, 50),
    "0 samples": held().part(0, 0),
    r"the force is nan in row 8 \(1 such": changed(force=with_value(held().force, 7, np.nan)),
    "the position is inf in row 1": changed(position=with_value(held().position, 0, np.inf)),
    "the force is constant": changed(force=np.full(8000, 2.0)),
    "the position never changes": changed(position=np.zeros(8000)),
    "force is in N and the position in rad; give both": changed(position_unit="rad"),
    "force is in Nm and the position in m; give both": changed(force_unit="Nm"),
    "8000 samples of force and 7999 of position": changed(position=held().position[1:]),
    "look swapped.*exchange them with --columns": changed(
        force=held().position, position=held().force
    ),
}


@pytest.mark.parametrize("message", REFUSED)
def test_what_cannot_be_used(message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        check_recording(REFUSED[message])
    assert str(caught.value).startswith("held: ")
    assert "\n" not in str(caught.value)


def test_the_other_kind_of_device() -> None:
    with pytest.raises(InputError, match="translational recording .* phantom is rotational"):
        check_recording(held(), load_device("phantom"))


def test_a_period_that_no_loop_has_is_said_before_anything_that_follows_from_it() -> None:
    for period_s in (1e3, 1e-6):
        with pytest.raises(InputError, match="sampling period is .* s, which no haptic loop has"):
            bh.analyse(changed(period_s=period_s), "free")
    with pytest.raises(InputError, match="which no haptic loop has"):
        bh.estimate_etfe(changed(period_s=1e3))


def test_the_fewest_samples_will_do() -> None:
    assert check_recording(held().part(0, FEWEST_SAMPLES)) == ()


WARNED = {
    "steps of 0.00314 m, 1e\\+03 times the encoder's resolution": (
        changed(position=1e3 * held().position, encoder_resolution=3.14e-6),
        "units",
    ),
    "steps of 0.00018 m, 57.3 times .*is it in degrees": (
        changed(position=held().position * 180 / np.pi, encoder_resolution=3.14e-6),
        "units",
    ),
    "sampling period is 1 s, which no haptic loop has": (
        changed(period_s=1.0),
        "units",
    ),
    "time steps vary by 3 % of the period": (changed(time_jitter=0.03), "time stamps"),
    r"answers as 0.00017 kg would.*positions 1000 times as small \(are they in mm": (
        changed(position=1e3 * held().position),
        "units",
    ),
    "positions are whole numbers, from -?[0-9]+ to": (
        changed(position=np.round(held().position / 3.14e-6)),
        "units",
    ),
    "forces are whole numbers, from -[0-9]+ to .* N: are they counts": (
        changed(force=np.round(100 * held().force), position=100 * held().position),
        "units",
    ),
    "multiples of 0.0225, and 16,000 of that are 360: are they in degrees": (
        changed(
            force_unit="Nm",
            position_unit="rad",
            position=0.0225 * np.round(held().position / 3.14e-6),
            force=1e4 * held().force,
        ),
        "units",
    ),
    "hardly answers to the force": (changed(force=held().force[::-1]), "coherence"),
    "recorded one sample early": (
        changed(force=held().force[:-1], position=held().position[1:]),
        "alignment",
    ),
}


@pytest.mark.parametrize("turn", [1000, 16_000, 65_536, 400_000])
def test_steps_of_a_turn(turn: int) -> None:
    assert steps_of_a_turn(360 / turn) == turn
    assert steps_of_a_turn(2 * np.pi / turn) is None  # radians


def test_what_a_file_was_rounded_to_is_no_part_of_a_turn() -> None:
    assert not any(steps_of_a_turn(digit * 10.0**-n) for digit in (1, 2, 5) for n in range(9))
    assert steps_of_a_turn(None) is None


@pytest.mark.parametrize("text", WARNED)
def test_what_is_warned_of(text: str) -> None:
    recording, topic = WARNED[text]
    (notice,) = check_recording(recording)
    assert (notice.level, notice.topic) == ("warning", topic)
    assert re.search(text, notice.text)


@pytest.mark.parametrize("per_unit", [1.0, 1e-3])
def test_positions_that_were_scaled_by_their_own_size_have_no_unit(per_unit: float) -> None:
    position = held().position
    made = {
        "a standard deviation of 1": (position - position.mean()) / position.std(),
        "reach 1, and no farther": position / np.abs(position).max(),
        "from 0 to 1": np.clip(1.2 * (position - position.min()) / np.ptp(position), 0, 1),
    }
    made["deviation of 1"] = (position - position.mean()) / position.std(ddof=1)
    for text, scaled in made.items():
        found = check_recording(changed(position=per_unit * scaled, force=per_unit * held().force))
        assert in_doubt("position", found) and any(text in notice.text for notice in found)


def test_a_position_that_happens_to_reach_one_is_not_normalised() -> None:
    reaching = held().position / np.abs(held().position).max()
    for position in (
        np.round(reaching, 3),  # as a file was written
        np.clip(1.2 * reaching, -1.0, 1.0),  # as a sensor cuts off
        1.0001 * reaching,
        held().position,
    ):
        assert not normalised(changed(position=position))


def test_a_device_file_betrays_units() -> None:
    lhifam = replace(load_device("lhifam"), encoder_resolution=None)
    for factor in (1e3, 1e-3):
        for part in ("force", "position"):
            recording = changed(**{part: factor * getattr(held(), part)})
            (notice,) = check_recording(recording, lhifam)
            assert notice.topic == "units"
            too_large = (factor > 1) == (part == "position")
            cure = (
                "small (are they in mm?), as in position=NAME[mm]"
                if too_large
                else "position=NAME[m]"
            )
            assert cure in notice.text and ("position=NAME[mm]" in notice.text) == too_large
            assert in_doubt("position", (notice,))
    # Where no force constant is known the device's masses say nothing.
    assert check_recording(changed(force_unit="A", force=1e3 * held().force), lhifam) == ()
    phantom = held("phantom")
    degrees = replace(phantom, position=phantom.position * 180 / np.pi)
    assert topics(check_recording(degrees, load_device("phantom"))) == ["units"]


def test_a_count_that_is_coarser_than_what_the_position_shows() -> None:
    """A count of 1 m was believed, with a stiffness in green, and with it any friction hides."""
    with pytest.raises(
        InputError, match="count .* 1 m, and the whole motion is 0.0.*correct --enc"
    ):
        check_recording(changed(encoder_resolution=1.0))
    with pytest.raises(InputError, match="whole motion"):
        check_recording(changed(encoder_resolution=1.0), load_device("lhifam"))
    (notice,) = check_recording(changed(encoder_resolution=2e-4))
    assert "correct --encoder-resolution" in notice.text and in_doubt("position", (notice,))
    assert check_recording(changed(encoder_resolution=3.14e-5)) == ()  # of a filtered position


def test_a_motion_of_a_few_counts() -> None:
    count = np.ptp(held().position) / 15
    coarse = changed(position=np.round(held().position / count) * count)
    assert "resolution" in topics(check_recording(coarse))


def test_a_coarser_encoder_and_another_period_than_the_device_file_says() -> None:
    lhifam = load_device("lhifam")
    coarse = changed(position=np.round(held().position, 5))
    (notice,) = check_recording(coarse, lhifam)
    assert (notice.level, notice.topic) == ("note", "resolution")
    assert topics(check_recording(held(), replace(lhifam, period_s=2e-3))) == ["period"]
    (notice,) = check_recording(held(), replace(lhifam, period_s=held().period_s / 4))
    assert notice.topic == "period" and "one sample in 4 was written down" in notice.text


def test_feedback_is_warned_of() -> None:
    rng = np.random.default_rng(5)
    noise = SCALE["lhifam"]["rms"] * band_noise(rng, (1, 8000), 200.0)

    def wall(k: int, position: np.ndarray, wanted: np.ndarray) -> np.ndarray:
        return wanted - 3000 * position[:, k]

    force, position = record("lhifam grasped", noise, rng, control=wall)
    (notice,) = check_recording(Recording(force[0], position[0], PERIOD))
    assert (notice.level, notice.topic) == ("warning", "feedback")
    assert "made in closed loop" in notice.text
    force, position = record("lhifam grasped", noise, rng, control=relay)
    with pytest.raises(InputError, match="between -3 and 3 N.*bayeshaptic relay held.csv"):
        check_recording(Recording(force[0], position[0], PERIOD, source=Path("held.csv")))


def test_a_doubt_of_feedback_is_no_certainty(monkeypatch: pytest.MonkeyPatch) -> None:
    """That it is only a doubt is data of the warning, whatever its words are."""
    for has_feedback in (True, False):
        found = SimpleNamespace(
            has_feedback=has_feedback, doubtful=True, evidence="", relay=False, swapped=False,
            opposite=False, early_position=False, far_past=False,
        )  # fmt: skip
        monkeypatch.setattr(what_drives_what, "causality", lambda _, found=found: found)
        notices = check_recording(held())
        assert topics(notices) == ["feedback"] and is_certain(notices) == has_feedback
        assert "opposite sign" not in notices[0].text
        turned = check_recording(changed(position=-held().position))  # a controller opposes, too
        assert topics(turned) == ["feedback"] and "opposite sign" in turned[0].text


@pytest.mark.parametrize(
    ("far_past", "said"), [(True, ", or is noise of a band"), (False, "was computed from the mot")]
)
def test_noise_of_a_band_is_not_said_to_be_feedback(
    far_past: bool, said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not at the door, and not where all lines are fitted because of it."""
    found = SimpleNamespace(
        has_feedback=True, doubtful=True, evidence="", relay=False, swapped=False,
        opposite=False, early_position=False, far_past=far_past,
    )  # fmt: skip
    monkeypatch.setattr(what_drives_what, "causality", lambda _: found)
    fitted = opened_directly(opened(held(), "grasped", Options()), Options())
    assert fitted is not None
    (note,) = (n for n in fitted.notices if n.topic == "feedback")
    assert note.level == "note" and said in note.text
    assert ("or is noise" in note.text) == bool(doubts(fitted.notices)) == far_past


def test_the_measured_recordings(measured: Callable[[str], Path]) -> None:
    for name, columns, expected in (
        ("emps/DATA_EMPS.mat", "time=t,force=vir*35.15[N],position=qm[m]", ["feedback"]),
        (
            "two_mass_bench/MultisineTypeA.mat",
            "time=time*1e-6,force=iq_refx[A],position=theta_mx[rad]",
            [],
        ),
    ):
        notices = check_recording(read_recording(measured(name), columns))
        assert [notice.topic for notice in notices] == expected


def one_mass(mass: float, force_unit: str | None, position_unit: str | None) -> Recording:
    rng = np.random.default_rng(5)
    force, pole = rng.standard_normal(4000), 0.99
    velocity = lfilter([0.0, PERIOD / mass], [1.0, -pole], force)
    position = lfilter([0.0, PERIOD], [1.0, -0.995], velocity)
    return recording_from_arrays(
        force, position, PERIOD, force_unit=force_unit, position_unit=position_unit
    )


@pytest.mark.parametrize(
    ("mass", "said", "doubted"),
    [
        (
            250.0,
            False,
            True,
        ),  # a quarter of a kilogram in a unit that is a thousand times too large
        (250.0, True, True),
        (95.0, False, True),
        (95.0, True, False),  # a servo axis of a machine tool
        (1.7e-7, True, True),
    ],
)
def test_a_mass_that_no_device_has_is_doubted(mass: float, said: bool, doubted: bool) -> None:
    """A limit of 21 MN/m was recommended of positions in m that were read as mm."""
    units = ("N", "m") if said else (None, None)
    found = check_recording(one_mass(mass, *units))
    assert in_doubt("position", found) == doubted
    assert any("slip of units" in notice.text for notice in found) == doubted


def test_a_device_file_that_says_the_mass_confirms_the_units() -> None:
    heavy = one_mass(250.0, "N", "m")
    device = Device("mine", "translational", parameters={"rigid": {"m": 250.0}})
    assert not in_doubt("position", check_recording(heavy, device))
    nothing = replace(device, parameters={})
    assert in_doubt("position", check_recording(heavy, nothing))
    light = replace(device, parameters={"rigid": {"m": 0.25}})
    (notice,) = check_recording(heavy, light)
    assert in_doubt("position", (notice,)) and "position=NAME[m]" in notice.text


def test_a_scale_in_doubt_is_none_where_the_device_file_agrees() -> None:
    """The steps say another unit, the masses that it is the encoder's resolution that is wrong."""
    fine = changed(encoder_resolution=3.14e-3)
    assert in_doubt("position", check_recording(fine))
    found = check_recording(fine, load_device("lhifam"))
    assert "units" in topics(found) and not in_doubt("position", found)


@pytest.mark.parametrize(
    ("columns", "doubted"),
    [
        ("force=u,position=y", True),
        ("force=u,position=y[m]", True),
        ("force=u,position=y*3.14e-6[m]", False),
        ("force=u,position=x", False),
        ("force=u_V,position=x", False),
        ("force=u,position=x[mm]", True),
    ],
)
def test_a_position_in_counts_is_in_doubt(tmp_path: Path, columns: str, doubted: bool) -> None:
    """A limit in N/m of counts that were taken for metres was recommended."""
    recording = held()
    counts = np.round(recording.position / np.ptp(recording.position) * 30000)
    path = tmp_path / "a.npz"
    np.savez(path, u=recording.force, u_V=recording.force, y=counts, x=recording.position)
    found = check_recording(read_recording(path, columns, period_s=recording.period_s))
    assert in_doubt("position", found) == doubted


@pytest.mark.parametrize(
    ("columns", "assumed"),
    [
        ("force=u,position=x", True),
        ("force=u,position=x[mm]", False),
        ("time=t_s,force=u,position=x[mm]", False),
    ],
)
def test_a_unit_that_was_said_is_not_called_unsaid(
    tmp_path: Path, columns: str, assumed: bool
) -> None:
    """Notes about the force or the time were taken for notes about the position."""
    path = tmp_path / "a.npz"
    time = PERIOD * np.arange(held().samples)
    np.savez(path, u=held().force, x=held().position, t_s=time)
    recording = read_recording(path, columns, None if "t_s" in columns else PERIOD)
    assert is_assumed("position", recording.notices) == assumed
    assert is_assumed("force", recording.notices)
