"""The figures of the paper as published, from data/paper-tables.toml."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).parents[2]
TABLES: dict[str, Any] = tomllib.loads((ROOT / "data" / "paper-tables.toml").read_text())

# Device and model, in the order of the paper's Table III.
CASES = (("phantom", "grasped"), ("phantom", "free"), ("lhifam", "grasped"), ("lhifam", "free"))
TITLES = {
    ("phantom", "grasped"): "PHANToM, held",
    ("phantom", "free"): "PHANToM, free",
    ("phantom", "rigid"): "PHANToM, rigid",
    ("lhifam", "grasped"): "LHIfAM, held",
    ("lhifam", "free"): "LHIfAM, free",
}
LEVER_M = TABLES["phantom"]["lever_m"]

# Half a unit of the last printed digit; 0.20 kg is read as two digits, the zero of b2 as zero.
HALF_UNITS = {
    ("phantom", "grasped"): {
        "m1": 5e-6, "b1": 5e-4, "bc": 5e-5, "kc": 5e-3, "m2": 5e-6, "b2": 0.0,
        "bs": 5e-4, "ks": 5e-3, "mh": 5e-6, "bh": 5e-4, "kh": 5e-3,
    },
    ("phantom", "free"): {
        "m1": 5e-7, "b1": 5e-5, "bc": 5e-5, "kc": 5e-3, "m2": 5e-7, "b2": 0.0,
    },
    ("phantom", "rigid"): {"m": 5e-6, "b": 5e-5},
    ("lhifam", "grasped"): {
        "m1": 5e-3, "b1": 0.05, "bc": 5e-3, "kc": 5.0, "m2": 5e-3, "b2": 0.05,
        "bs": 5e-3, "ks": 5.0, "mh": 5e-3, "bh": 5e-3, "kh": 5e-3,
    },
    ("lhifam", "free"): {
        "m1": 5e-3, "b1": 0.05, "bc": 0.5, "kc": 50.0, "m2": 5e-3, "b2": 0.05,
    },
}  # fmt: skip

# Bins of the power spectral density that Table IV's frequencies were read from.
BIN_HZ = {"phantom_grasped": 1000 / 2048, "phantom_free": 1000 / 2048,
          "lhifam_grasped": 1000 / 4096, "lhifam_free": 1000 / 4096}  # fmt: skip


def values(device: str, model: str) -> dict[str, float]:
    """The paper's Table I (PHANToM) or II (LHIfAM), without the delay."""
    table = TABLES[device][model]
    return {name: value for name, value in table.items() if name != "delay_s"}


def delay_s(device: str) -> float:
    return float(TABLES[device]["free"]["delay_s"])


def margin(device: str, model: str) -> tuple[float, float]:
    """Table III: gain margin in dB and frequency in Hz."""
    row = TABLES["table_3"][f"{device}_{model}"]
    return row["gain_margin_db"], row["frequency_hz"]


def relays(device: str, model: str) -> tuple[np.ndarray, np.ndarray]:
    """Table IV: gain margins in dB and frequencies in Hz, one a trial or user."""
    rows = TABLES["table_4"][f"{device}_{model}"]
    gains, frequencies = ([row[key] for row in rows] for key in ("gain_margin_db", "frequency_hz"))
    return np.array(gains), np.array(frequencies)


def decibel(value: float | np.ndarray) -> np.ndarray:
    return 20 * np.log10(value)
