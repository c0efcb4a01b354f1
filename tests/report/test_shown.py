"""What results say of themselves at a prompt, in a notebook, and to other libraries."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fake_analysis import fake_analysis, fake_closed
from fake_study import fake_study

import bayeshaptic as bh
from bayeshaptic.inference.saved.arviz_groups import import_arviz
from bayeshaptic.report.walls.section import case_of, table_of

ROOT = Path(__file__).parents[2]
RELAY = ROOT / "data" / "recordings" / "phantom-user-relay.csv.gz"
ANALYSIS = fake_analysis("free", spread=0.01)
SHOWN: dict[str, Any] = {
    "recording": ANALYSIS.recording,
    "response": ANALYSIS.etfe,
    "device": ANALYSIS.device,
    "model": ANALYSIS.model,
    "fit": ANALYSIS.fit,
    "posterior": ANALYSIS.posterior,
    "limit": ANALYSIS.limit,
    "closed": fake_closed(),
    "study": fake_study(people=1, free=1),
    "walls": table_of([case_of(ANALYSIS)], draws=60),
    "relay": bh.measure_relay(bh.read_recording(RELAY)),
    "study file": bh.read_study(ROOT / "examples" / "study" / "study.toml"),
    "limit of the response": ANALYSIS.etfe_limit,
    "case": case_of(ANALYSIS),
    "region": bh.kb_region(ANALYSIS.posterior, draws=60),
    "shares": bh.variance_shares(ANALYSIS.posterior, draws=200),
    "elasticities": bh.elasticities(ANALYSIS.posterior, draws=200)[0],
    "sweep": bh.sweep(ANALYSIS.posterior, "kc", draws=60),
}


@pytest.mark.parametrize("name", SHOWN)
def test_a_result_shows_itself_in_three_lines(name: str) -> None:
    lines = repr(SHOWN[name]).split("\n")
    assert len(lines) <= 3 and all(0 < len(line) < 160 for line in lines)
    assert "array(" not in repr(SHOWN[name]) and "_" not in lines[0]
    assert SHOWN[name]._repr_html_().startswith("<div><strong>")


@pytest.mark.parametrize(
    "name", ["recording", "response", "fit", "posterior", "limit", "case", "region", "walls"]
)
def test_a_result_is_equal_to_itself_alone(name: str) -> None:
    one = SHOWN[name]
    other = copy.deepcopy(one)
    assert one == one and one != other and one in [other, one] and other not in [one]
    assert len({one, other}) == 2


@pytest.mark.parametrize(
    "thing",
    [
        bh.grasped(device="phantom"),
        bh.load_device("lhifam"),
        bh.Options(prior={"m1": bh.LogNormal(0.2, 0.1)}, effects={"each": 0.1}),
        bh.Settings(columns="time=t,force=u,position=q"),
        bh.read_study(ROOT / "examples" / "study" / "study.toml"),
    ],
    ids=lambda thing: type(thing).__name__,
)
def test_what_is_equal_has_one_hash(thing: Any) -> None:
    assert {thing, copy.deepcopy(thing)} == {thing}


def test_numbers_have_units() -> None:
    assert "N/m, median and 90 % interval" in repr(ANALYSIS.limit)
    assert "kg" in repr(ANALYSIS.fit) and "kg" in repr(ANALYSIS.posterior)
    assert "30.0 s" in repr(ANALYSIS.recording)


TABLES = [("shares", 3), ("elasticities", 6), ("sweep", 25)]


@pytest.mark.parametrize(
    ("name", "rows"), [("fit", 6), ("posterior", 6), ("response", 110), ("study", 3), *TABLES]
)
def test_tables_become_data_frames(name: str, rows: int) -> None:
    pytest.importorskip("pandas", reason="pandas is not installed")
    frame = SHOWN[name].to_dataframe()
    assert len(frame) >= rows
    if name == "posterior":
        assert frame.loc["m1", "q50"] == pytest.approx(ANALYSIS.posterior.quantile(0.5)[0])


def test_without_pandas_one_line_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "pandas", None)
    with pytest.raises(bh.InputError, match="pip install pandas"):
        ANALYSIS.fit.to_dataframe()


@pytest.mark.parametrize("device", ["lhifam", "phantom"])
@pytest.mark.parametrize("model", [bh.rigid, bh.free, bh.grasped])
@pytest.mark.parametrize("delay_s", [0.0, 0.3e-3, 2.4e-3])
def test_python_control_has_the_same_loop(model: Any, device: str, delay_s: float) -> None:
    pytest.importorskip("control", reason="python-control is not installed")
    known = model(device=device, delay_s=delay_s)
    loop = known.to_control()
    frequency = np.geomspace(0.5, 450.0, 40)
    at = loop(np.exp(2j * np.pi * frequency * known.period_s))
    np.testing.assert_allclose(at, known.response(known.values, frequency), rtol=1e-8)
    limit = bh.critical_stiffness(known).value
    for share, stable in ((0.99, True), (1.01, False)):
        poles = np.linalg.eigvals(loop.A - share * limit * loop.B @ loop.C)
        assert (np.abs(poles).max() < 1) == stable


def test_a_model_without_finitely_many_states_says_so() -> None:
    from bayeshaptic.effects.library import effects

    pytest.importorskip("control", reason="python-control is not installed")
    model = bh.grasped(device="lhifam")
    (kind,) = (one for one in effects("linear") if one.name == "reflex")
    with pytest.raises(bh.InputError, match="no finite number of states"):
        extended = model.with_effect(kind.candidates(model, ANALYSIS.etfe)[0])
        theta = np.append(model.values, np.full(extended.size - model.size, 1e-2))
        extended.to_control(theta)


def test_arviz_sees_what_the_report_says(tmp_path: Path) -> None:
    """R-hat, effective draws and the predictive check, of the object and of the file."""
    arviz = import_arviz()
    posterior = ANALYSIS.posterior
    data = posterior.to_arviz()
    assert data.posterior["m1"].attrs["units"] == "kg"
    quantile = float(data.posterior["m1"].quantile(0.5))
    assert quantile == pytest.approx(posterior.quantile(0.5)[0], rel=1e-12)
    assert data.posterior.sizes["chain"] == len(posterior.chains)
    for found in (data, arviz.from_netcdf(posterior.save(tmp_path / "p.nc"))):
        rhat, bulk, tail = arviz.rhat(found), arviz.ess(found), arviz.ess(found, method="tail")
        for i, name in enumerate(posterior.names):
            # Of four chains, R-hat of independent draws scatters by 1.5 / (draws of a chain).
            assert float(rhat[name]) == pytest.approx(posterior.rhat[i], abs=4e-3)
            ours = posterior.diagnostics.fewest[i]
            assert 0.5 * ours < min(float(bulk[name]), float(tail[name])) < 1.5 * ours
    assert data.posterior["m1"].attrs["rhat"] == posterior.rhat[0]
    assert set(data.observed_data.data_vars) == set(data.posterior_predictive.data_vars)
    assert set(arviz.summary(data, var_names=["m1", "kc"]).index) == {"m1", "kc"}
