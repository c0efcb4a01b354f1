"""Device files: the published values, and what is said of a file that is wrong."""

from __future__ import annotations

from pathlib import Path

import pytest

from bayeshaptic.devices import STRUCTURES, Device, device_names, load_device
from bayeshaptic.errors import InputError

# Diaz and Gil 2010, Tables I and II.
PUBLISHED = {
    "phantom": {
        "rigid": (1.05e-3, 0.0085),
        "free": (0.895e-3, 0.0085, 0.0057, 18.13, 0.155e-3, 0.0),
        "grasped": (0.81e-3, 0.057, 0.0084, 18.11, 0.95e-3, 0, 0.017, 52.73, 3.14e-3, 0.099, 1.42),
    },
    "lhifam": {
        "rigid": (0.19 + 5.20, 0.1 + 6.8),
        "free": (0.19, 0.1, 15.0, 55.3e3, 5.20, 6.8),
        "grasped": (0.2, 0.1, 13.41, 61.36e3, 3.78, 4.0, 62.68, 56.03e3, 1.42, 18.34, 133.48),
    },
}


def test_every_device_file_is_tested() -> None:
    assert device_names() == ("lhifam", "phantom")


@pytest.mark.parametrize("name", PUBLISHED)
def test_published_values(name: str) -> None:
    device = load_device(name)
    assert device.name == name
    assert device.period_s == 1e-3
    for structure, values in PUBLISHED[name].items():
        given = device.parameters[structure]
        assert tuple(given) == STRUCTURES[structure]
        assert tuple(given.values()) == pytest.approx(values, rel=1e-12)
    assert any("10.1109" in note or "26(1)" in note for note in device.notes)


def test_facts() -> None:
    lhifam, phantom = load_device("LHIfAM"), load_device("phantom")
    assert (lhifam.kind, lhifam.position_unit, lhifam.force_unit) == ("translational", "m", "N")
    assert (phantom.kind, phantom.position_unit, phantom.force_unit) == ("rotational", "rad", "Nm")
    assert (lhifam.delay_s, phantom.delay_s) == (200e-6, 150e-6)
    assert (lhifam.encoder_resolution, phantom.encoder_resolution) == (3.14e-6, None)
    assert (lhifam.lever_m, phantom.lever_m) == (None, 0.12)
    assert (lhifam.band_hz, phantom.band_hz) == ((0.3, 300.0), (0.7, 200.0))
    assert load_device(lhifam) is lhifam


def test_the_rigid_limit_of_the_paper() -> None:
    # Equation (19) and Table III: 907.69 N/m at the tip; b and td are printed with two digits.
    phantom = load_device("phantom")
    assert phantom.period_s
    assert phantom.delay_s
    assert phantom.lever_m
    limit = phantom.parameters["rigid"]["b"] / (phantom.period_s / 2 + phantom.delay_s)
    assert limit / phantom.lever_m**2 == pytest.approx(907.69, rel=0.5 / 85)


def test_a_file_of_ones_own(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(
        "kind = 'rotational'\ndelay_s = 1e-4\ndelay_sd_s = 2e-5\nlever_m = 1\nnotes = 'x'\n"
        "[free]\nm1 = 1e-3\nkc = 20\n",
        encoding="utf-8",
    )
    device = load_device(path)
    assert device == Device(
        "mine",
        "rotational",
        delay_s=1e-4,
        delay_sd_s=2e-5,
        lever_m=1.0,
        parameters={"free": {"m1": 1e-3, "kc": 20.0}},
        notes=("x",),
    )
    assert load_device(str(path)) == device


def test_an_unknown_device() -> None:
    with pytest.raises(
        InputError,
        match=r"unknown device 'lhifan' \(did you mean 'lhifam'\?\); known devices: "
        r"lhifam, phantom; the path of a device file \(.toml\) works too",
    ):
        load_device("lhifan")
    with pytest.raises(InputError, match="none.toml: no such file"):
        load_device("none.toml")


WRONG = {
    "": "needs a kind",
    "kind = 'linear'": "kind must be 'translational' or 'rotational', not 'linear'",
    "kind = 'rotational'\nperiod = 1e-3": r"unknown key 'period' \(did you mean 'period_s'\?\)",
    "kind = 'rotational'\nperiod_s = 0": "period_s must be a number above 0, not 0",
    "kind = 'rotational'\nperiod_s = true": "period_s must be a number above 0, not True",
    "kind = 'rotational'\ndelay_s = '1e-3'": "delay_s must be a number of at least 0, not '1e-3'",
    "kind = 'rotational'\nperiod_s = 1e-3\nband_hz = [1, 600]": "band_hz ends above 500 Hz",
    "kind = 'rotational'\ndelay_sd_s = 1e-5": "delay_sd_s without delay_s",
    "kind = 'rotational'\nlever_m = inf": "lever_m must be a number above 0, not inf",
    "kind = 'rotational'\nband_hz = [9, 1]": "band_hz must be two frequencies",
    "kind = 'rotational'\nband_hz = 'all'": "band_hz must be two frequencies",
    "kind = 'rotational'\nnotes = 3": "notes must be text or a list of texts, not 3",
    "kind = 'rotational'\n[free]\nmm1 = 1": r"\[free\] has an unknown key 'mm1' \(did you",
    "kind = 'rotational'\n[free]\nm1 = 0": r"\[free\]: m1 must be a number above 0",
    "kind = 'rotational'\n[free]\nb1 = -1": r"\[free\]: b1 must be a number of at least 0",
    "kind = 'rotational'\nfree = 3": r"\[free\] must be a table",
    "kind = rotational": r"not valid TOML: .*line 1",
}


@pytest.mark.parametrize("content", WRONG)
def test_wrong_device_files(tmp_path: Path, content: str) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(content, encoding="utf-8")
    with pytest.raises(InputError, match=WRONG[content]) as caught:
        load_device(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)
