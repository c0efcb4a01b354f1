"""`summary.json`: the contract, key by key, whatever the analysis lacks."""

from __future__ import annotations

import dataclasses
import json
import math
from typing import Any

import numpy as np
import pytest
from fake_analysis import CASES, FakeClosed, fake_analysis

import bayeshaptic
from bayeshaptic.report import summary, summary_json

QUANTILES = {"q05", "q50", "q95"}
ERROR = {
    "weighted_rms",
    "held_out_weighted_rms",
    "gain_db_rms",
    "phase_deg_rms",
    "critical_stiffness",
    "critical_stiffness_db",
}
KEYS: dict[str, set[str]] = {
    "": {
        "version",
        "recording",
        "etfe",
        "model",
        "least_squares",
        "posterior",
        "critical_stiffness",
        "recommendation",
        "hidden",
        "diagnosis",
        "error",
        "notices",
        "provenance",
    },
    "recommendation": {"status", "stiffness", "risk", "sentence"},
    "recording": {
        "file",
        "device",
        "user",
        "configuration",
        "period_s",
        "samples",
        "kind",
        "excitation_rms",
        "feedback",
    },
    "etfe": {"lines", "frequency_hz", "median_relative_sd", "period_lines"},
    "model": {"name", "effects", "parameters"},
    "least_squares": {"parameters", "reduced_chi_square"},
    "posterior": {"parameters", "draws", "ess_min", "rhat_max", "seconds"},
    "critical_stiffness": {
        "unit",
        *QUANTILES,
        "db",
        "frequency_hz",
        "tip",
        "crossings",
        "etfe",
        "etfe_as_measured",
        "safe",
        "declared",
        "reason",
    },
    "critical_stiffness.db": QUANTILES,
    "critical_stiffness.frequency_hz": QUANTILES,
    "critical_stiffness.etfe": QUANTILES,
    "critical_stiffness.etfe_as_measured": QUANTILES,
    "critical_stiffness.safe": {"0.05", "0.01", "0.001"},
    "diagnosis": {"verdict", "residual_class", "effects", "candidates", "not_tried"},
    "error": {"before", "before_like_after", "after"},
    "provenance": {"command", "options", "versions", "seed", "file", "sha256", "seconds"},
    "error.before": ERROR,
    "error.before_like_after": ERROR,
    "error.after": ERROR,
    "error.before.critical_stiffness": QUANTILES,
    "error.after.critical_stiffness": QUANTILES,
}
POSTERIOR = {
    "mean",
    "sd",
    "q05",
    "q50",
    "q95",
    "unit",
    "ess_bulk",
    "ess_tail",
    "rhat",
    "prior_dominated",
    "trusted",
}


def at(found: dict[str, Any], path: str) -> Any:
    for key in path.split(".") if path else ():
        found = found[key]
    return found


def strictly_parsed(text: str) -> dict[str, Any]:
    def refuse(constant: str) -> None:
        raise AssertionError(f"{constant} is not JSON")

    return json.loads(text, parse_constant=refuse)


@pytest.mark.parametrize("case", CASES)
def test_every_key_is_there_and_no_other(case: str) -> None:
    found = strictly_parsed(summary_json(fake_analysis(**CASES[case])))
    for path, keys in KEYS.items():
        assert set(at(found, path)) == keys, path
    for row in found["least_squares"]["parameters"].values():
        assert set(row) == {"value", "sd", "unit"}
    for row in found["posterior"]["parameters"].values():
        assert set(row) == POSTERIOR
    for row in found["critical_stiffness"]["crossings"]:
        assert set(row) == {"label", "frequency_hz", "probability"}
    names = found["model"]["parameters"]
    assert list(found["posterior"]["parameters"]) == names
    assert list(found["least_squares"]["parameters"]) == names


def test_numbers_are_those_of_the_analysis() -> None:
    analysis = fake_analysis("free", spread=0.01)
    found = summary(analysis)
    assert found["version"] == bayeshaptic.__version__
    limit = found["critical_stiffness"]
    assert limit["q50"] == np.quantile(analysis.limit.samples, 0.5)
    assert limit["db"]["q50"] == pytest.approx(20 * math.log10(limit["q50"]), abs=1e-12)
    assert sum(c["probability"] for c in limit["crossings"]) == pytest.approx(1.0, abs=1e-12)
    column = analysis.posterior.draws[:, analysis.model.names.index("kc")]
    kc = found["posterior"]["parameters"]["kc"]
    assert kc["q05"] == np.quantile(column, 0.05)
    assert kc["unit"] == "N/m"
    below = np.mean(analysis.limit.samples < limit["safe"]["0.01"])
    assert below == pytest.approx(0.01, abs=1 / len(analysis.limit.samples))
    rms = np.sqrt(np.mean(analysis.recording.force**2))
    assert found["recording"]["excitation_rms"] == pytest.approx(rms, rel=1e-12)
    assert found["etfe"]["period_lines"] is None


def test_a_risk_that_the_draws_cannot_tell_is_null() -> None:
    # Of 256 draws 13 lie in the lowest 5 %: too few to fit a tail to.
    analysis = fake_analysis()
    few = analysis.limit.samples[:256]
    analysis.limit = dataclasses.replace(analysis.limit, samples=few)
    assert summary(analysis)["critical_stiffness"]["safe"]["0.001"] is None


def test_a_parameter_at_its_bound_has_no_error_bar() -> None:
    rows = summary(fake_analysis("rigid"))["least_squares"]["parameters"]
    assert rows["b"]["sd"] is None
    assert rows["m"]["sd"] > 0


def test_a_table_has_no_recording() -> None:
    found = summary(fake_analysis("rigid", table=True))["recording"]
    assert found["samples"] is found["excitation_rms"] is found["feedback"] is found["file"] is None
    assert found["period_s"] == 1e-3


def test_feedback_is_told_by_its_warning() -> None:
    assert summary(fake_analysis(**CASES["feedback"]))["recording"]["feedback"] is True
    assert summary(fake_analysis())["recording"]["feedback"] is False


def test_the_tip_needs_a_lever_and_a_torque() -> None:
    held = summary(fake_analysis(device="phantom", lever_m=0.12))["critical_stiffness"]
    assert held["tip"]["unit"] == "N/m"
    assert held["tip"]["q50"] == pytest.approx(held["q50"] / 0.12**2, rel=1e-12)
    assert summary(fake_analysis(device="phantom"))["critical_stiffness"]["tip"] is None
    current = fake_analysis(**CASES["amperes"] | {"lever_m": 0.12})
    assert summary(current)["critical_stiffness"]["tip"] is None


def test_infinite_and_vanishing_limits_become_null() -> None:
    analysis = fake_analysis("rigid")
    for value, frequency in ((np.inf, np.nan), (0.0, 0.0)):
        samples = np.full_like(analysis.limit.samples, value)
        limit = dataclasses.replace(
            analysis.limit, samples=samples, frequency_hz=np.full_like(samples, frequency)
        )
        analysis.limit = limit
        found = strictly_parsed(summary_json(analysis))["critical_stiffness"]
        assert found["db"] == dict.fromkeys(QUANTILES)
        assert found["q50"] == (0.0 if value == 0 else None)


def test_a_limit_decades_from_anything_measured_is_missing_with_the_reason() -> None:
    analysis = fake_analysis("rigid")
    analysis.limit = dataclasses.replace(analysis.limit, samples=analysis.limit.samples * 1e-150)
    found = summary(analysis)["critical_stiffness"]
    assert found["q50"] is None and found["db"]["q50"] is None and found["safe"]["0.01"] is None
    assert "decades" in found["reason"] and found["etfe"]["q50"] > 0


def test_what_closing_the_loop_adds() -> None:
    rigid = fake_analysis("rigid")
    closed = FakeClosed(
        analysis=rigid,
        base=rigid,
        diagnosis={
            "verdict": "explained",
            "residual_class": "nonlinear",
            "effects": [{"name": "coulomb_friction"}],
        },
        before={"weighted_rms": 12.5},
        before_like_after={"weighted_rms": 40.0},
        after={"weighted_rms": np.float64(1.02), "critical_stiffness_db": math.nan},
    )
    found = strictly_parsed(summary_json(closed))
    assert found["diagnosis"]["verdict"] == "explained"
    assert found["diagnosis"]["candidates"] is None
    assert found["model"]["effects"] == ["coulomb_friction"]
    assert found["error"]["before"]["weighted_rms"] == 12.5
    assert found["error"]["before_like_after"]["weighted_rms"] == 40.0
    assert found["error"]["after"]["critical_stiffness_db"] is None
    assert found["error"]["after"]["critical_stiffness"] == dict.fromkeys(QUANTILES)
    assert found["model"]["name"] == "rigid"
