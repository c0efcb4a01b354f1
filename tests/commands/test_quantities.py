"""Numbers with units as people write them."""

from __future__ import annotations

import pytest

from bayeshaptic.quantities import estimate, interval, percent, quantity, scale


@pytest.mark.parametrize(
    ("value", "unit", "sd", "text"),
    [
        (22_145.0, "N/m", 130.0, "22.14 kN/m"),
        (22_145.0, "N/m", None, "22.1 kN/m"),
        (8.5e-4, "kg m^2", 3e-6, "0.8500 g m²"),
        (0.19, "kg", 4e-4, "0.19000 kg"),
        (200e-6, "s", 1e-6, "200.0 µs"),
        (0.0084, "N m s/rad", 0.001, "8.4 mN m s/rad"),
        (999.7, "N/m", None, "1.00 kN/m"),
        (13.2, "A/rad", 0.3, "13.20 A/rad"),
        (-3.0, "dB", 0.1, "−3.00 dB"),
        (102.84, "Hz", 0.2, "102.84 Hz"),
        (0.09998, "N m", None, "0.100 N m"),
        (0.0, "N s/m", 0.3, "0.00 N s/m"),
        (1.0, "", None, "1.00"),
        (float("inf"), "N/m", None, "–"),
        (None, "N/m", None, "–"),
    ],
)
def test_a_quantity_reads_well(value: float | None, unit: str, sd: float | None, text: str) -> None:
    assert quantity(value, unit, sd) == text


def test_an_interval_has_one_unit_and_no_more_digits_than_it_can_bear() -> None:
    assert interval(21_912.3, 22_391.9, "N/m") == "21.91 to 22.39 kN/m"
    assert interval(22_246.11, 22_246.13, "N/m") == "22.246 to 22.246 kN/m"
    assert estimate(22_330.0, 21_910.0, 22_690.0, "N/m") == "22.33 (21.91 to 22.69) kN/m"
    assert interval(None, 1.0, "N/m") == "–"


def test_an_interval_of_many_decades_stays_short() -> None:
    """What leaves everything open: one prefix wrote 23 zeros, for which a figure had no room."""
    assert estimate(13_950.0, 1e-3, 4e8, "N/m") == "14 kN/m (1.0 mN/m to 400 MN/m)"
    assert interval(1e-22, 4e15, "N/m") == "1.0e−13 nN/m to 4000000 GN/m"
    assert estimate(14_000.0, 12e3, float("inf"), "N/m") == "14.0 (12.0 to –) kN/m"
    assert scale(4e15, "N/m").number(1e-13, 4e15) == "1.0e−22"


def test_percentages_are_never_rounded_to_certainty() -> None:
    assert [percent(p) for p in (0.05, 0.01, 0.001, 0.34, 0.9996, 1e-5)] == [
        "5 %",
        "1 %",
        "0.1 %",
        "34 %",
        "over 99 %",
        "under 0.1 %",
    ]


def test_a_zero_without_an_error_is_a_zero() -> None:
    """A damper at its bound, in what a fit prints."""
    assert scale(0.0, "N s/m").with_error(0.0, float("nan")) == "0"


def test_an_error_is_rounded_as_its_number_is() -> None:
    """A mass was "220000 ± 315550"."""
    row = scale(1.0, "kg")
    assert row.with_error(222_345.0, 315_550.0) == "220000 ± 320000"
    assert row.with_error(99.6, 152.3) == "100 ± 150"
    assert row.with_error(0.5898, 0.0204) == "0.590 ± 0.020"


def test_a_row_has_one_scale() -> None:
    row = scale([950.0, 12_000.0], "N/m")
    assert [row.number(v, 30.0) for v in (950.0, 12_000.0)] == ["0.950", "12.000"]
