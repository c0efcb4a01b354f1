"""What could hide: its evidence by brute force, its average by hand, and the limit it gives."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from fake_analysis import fake_analysis
from linear_bench import RIGID, Device
from on_the_bench import recorded_on, usual_noise

from bayeshaptic.diagnosis.close_loop import close_loop, with_average
from bayeshaptic.diagnosis.closed import Closed
from bayeshaptic.diagnosis.hidden.average import average, looked_at
from bayeshaptic.diagnosis.hidden.evidence import Evidence, asked
from bayeshaptic.diagnosis.hidden.forces import force_suspects, slope_of
from bayeshaptic.diagnosis.hidden.hidden import averaged, with_hidden
from bayeshaptic.diagnosis.hidden.prior import HiddenPrior
from bayeshaptic.diagnosis.hidden.regression import around
from bayeshaptic.diagnosis.hidden.several import all_together
from bayeshaptic.diagnosis.hidden.sizes import sizes_of
from bayeshaptic.diagnosis.hidden.suspects import ForceSaid, Suspect, linear_suspects
from bayeshaptic.diagnosis.hidden.weighed import KEPT, PAIRED, Weighed, weigh
from bayeshaptic.diagnosis.options import Options
from bayeshaptic.diagnosis.residuals import residual
from bayeshaptic.diagnosis.thresholds import two_sided
from bayeshaptic.effects.library import effect_class
from bayeshaptic.errors import InputError
from bayeshaptic.inference import least_squares, sample
from bayeshaptic.inference.likelihood import Likelihood
from bayeshaptic.inference.posterior import Posterior
from bayeshaptic.models import build_model
from bayeshaptic.models.response.aliases import alias_sums
from bayeshaptic.recordings import recording_from_arrays
from bayeshaptic.recordings.response.estimate import estimate_etfe
from bayeshaptic.recordings.study_file import read_study
from bayeshaptic.report.headline import headline
from bayeshaptic.report.loop.words import in_short
from bayeshaptic.report.numbers.hidden import moves
from bayeshaptic.rig import Bench
from bayeshaptic.stability.critical import critical_stiffness
from bayeshaptic.stability.mixed import mixed


@pytest.fixture(scope="module")
def rigid() -> Posterior:
    """A posterior of two parameters."""
    rng = np.random.default_rng(2)
    force = rng.normal(size=8000)
    position = Device(RIGID).simulate(force)
    position = position + 1e-3 * position.std() * rng.normal(size=len(position))
    etfe = estimate_etfe(recording_from_arrays(force, position, 1e-3), (1.0, 200.0))
    fit = least_squares(build_model("rigid", delay_s=2e-4, period_s=1e-3), etfe)
    return sample(fit.model, etfe, start=fit, ess=1000)


def suspect_in(posterior: Posterior, name: str) -> Suspect:
    assert posterior.etfe is not None
    found = linear_suspects(posterior.model, posterior.etfe)
    return next(one for one in found if one.name == name)


@pytest.mark.parametrize("name", ["extra_delay", "centring_stiffness", "actuator_lag"])
def test_evidence_is_what_an_integral_over_everything_gives(rigid: Posterior, name: str) -> None:
    suspect = suspect_in(rigid, name)
    known = around(rigid, 400, np.random.default_rng(1))
    found = weigh(suspect, known, np.random.default_rng(1))
    sizes = sizes_of(suspect, known)
    # Both parameters over a grid that holds every place that the effect may push them to.
    spread = rigid.draws.std(axis=0)
    axes = [m + s * np.linspace(-14, 14, 90) for m, s in zip(known.theta, spread, strict=True)]
    grid = np.stack([a.ravel() for a in np.meshgrid(*axes, indexing="ij")], axis=1)
    grid = grid[np.all(grid > 0, axis=1)]
    prior = rigid.model.log_prior(grid)
    base = Likelihood(rigid.model, known.windows)(grid) + prior
    likelihood = Likelihood(suspect.model, known.windows)
    weight, each = 0.0, np.zeros(len(sizes.weight))
    for number, own in enumerate(sizes.own):
        vectors = suspect.vectors(grid, np.repeat(own[None], len(grid), axis=0))
        each[number] = np.exp(likelihood(vectors) + prior - base.max()).sum()
    weight = np.exp(base - base.max()).sum()
    exact = np.log(sizes.weight @ each / weight)
    assert found.log_evidence == pytest.approx(exact, abs=0.15)
    assert found.pareto_k < 0.7
    share = sizes.weight * each
    order = np.argsort(np.abs(sizes.strength))
    edges = np.cumsum(share[order]) / share.sum()
    exact95 = np.abs(sizes.strength)[order][np.searchsorted(edges, 0.95)]
    assert np.quantile(np.abs(found.strength), 0.95) == pytest.approx(exact95, rel=0.15)


def test_where_no_draw_is_possible_there_is_no_density(rigid: Posterior) -> None:
    suspect = suspect_in(rigid, "extra_delay")
    known = around(rigid, 50, np.random.default_rng(1))
    nowhere = np.full((3, 2), -1e3)
    vectors = suspect.vectors(np.abs(nowhere), np.zeros((3, 1)))
    assert np.all(known.density(suspect.model, vectors, nowhere) == -np.inf)


def weighed(name: str, evidence: float, changes: np.ndarray, factor: float = 0.0) -> Weighed:
    about = name, name, "linear", "", "", "", "", "", 1.0
    rows = np.repeat(changes[None], KEPT // PAIRED, axis=0)
    draws = np.ones(KEPT), np.full(KEPT, factor), rows, np.ones(KEPT), np.zeros((KEPT, 0))
    return Weighed(*about, evidence, 0.0, *draws)


def test_the_average_of_effects_that_share_nothing_is_bayes_rule_for_each(rigid: Posterior) -> None:
    known = around(rigid, 200, np.random.default_rng(1))
    _, _, right = np.linalg.svd(known.pull)
    apart = right[-2:]  # directions of the residuals that no parameter takes up
    evidence, prior = (1.0, -2.0), HiddenPrior(0.2)
    looked = looked_at(
        [
            weighed("extra_delay", evidence[0], apart[0], -0.1),
            weighed("reflex", evidence[1], apart[1]),
        ],
        known,
    )
    found = average(looked, prior)
    odds = 0.25 * np.exp(evidence)
    assert found.present == pytest.approx(odds / (1 + odds), rel=1e-6)
    assert found.nothing == pytest.approx(1 / np.prod(1 + odds), rel=1e-6)
    factors = found.log_factors(10_000, np.random.default_rng(0))
    assert np.mean(factors < -0.05) == pytest.approx(found.present[0], abs=2e-3)


def test_two_effects_that_explain_the_same_are_hardly_both_there(rigid: Posterior) -> None:
    known = around(rigid, 200, np.random.default_rng(1))
    same = 3 * np.linalg.svd(known.pull)[2][-1]
    looked = looked_at(
        [weighed("extra_delay", 4.0, same), weighed("actuator_lag", 4.0, same)], known
    )
    found = average(looked, HiddenPrior(0.2))
    assert looked.gain[0, 1] == pytest.approx(-9.0, rel=1e-6)
    assert found.pair[0, 1] < 0.05 * found.single.sum()


def test_with_no_probability_the_limit_is_the_declared_one(rigid: Posterior) -> None:
    assert rigid.etfe is not None
    limit = critical_stiffness(rigid)
    assert with_hidden(limit, rigid, rigid.etfe, (), (), HiddenPrior(0.0)) is None
    tiny = with_hidden(limit, rigid, rigid.etfe, (), (), HiddenPrior(1e-9))
    assert tiny is not None
    assert np.array_equal(tiny[0].samples, limit.samples) and tiny[1].nothing > 0.999999


def test_a_rival_does_not_hide_beside_itself(rigid: Posterior) -> None:
    known = around(rigid, 200, np.random.default_rng(1))
    right = np.linalg.svd(known.pull)[2]
    looked = looked_at([weighed("extra_delay", 9.0, right[-1], -0.5)], known)
    own = critical_stiffness(rigid)
    rng = np.random.default_rng(2)
    other = replace(own, samples=10 * own.samples)
    limit = mixed(own, [other], [0.5], ["extra_delay"], rng)
    found, hidden = averaged(limit, looked, HiddenPrior(0.5), rng)
    moved = np.log(found.samples / limit.samples)
    rival = limit.explained_by == 1
    assert np.all(moved[rival] == 0) and np.mean(moved[~rival] == -0.5) > 0.99
    assert hidden.effects[0].probability == pytest.approx(0.5, abs=0.01)


def test_sizes_of_another_recording_are_read_off_its_evidence() -> None:
    size = np.array([1.0, 2.0, 4.0, -1.0, -2.0])
    shape = np.array([[10.0], [10.0], [10.0], [10.0], [10.0]])
    log = np.array([-0.1, -0.4, -1.6, 0.2, 0.5])
    own = Evidence(size, shape, np.full(5, 0.2), log + 0.1, log)
    assert own.of(asked(size, shape)) == pytest.approx(log)
    others = own.of(asked(np.array([0.5, 8.0, 2.0, -0.5]), np.full((4, 1), 9.0)))
    assert others == pytest.approx([-0.025, -6.4, -0.4, 0.05])
    assert own.with_more(2 * log) == pytest.approx(np.log(0.2 * np.exp(3 * log + 0.1).sum()))


def test_two_recordings_rule_out_what_one_cannot(rigid: Posterior) -> None:
    """Of a clean device, and of one whose other recording shows the effect."""
    assert rigid.etfe is not None
    prior = HiddenPrior(0.0, {"extra_delay": 0.1, "actuator_lag": 0.1})
    made = with_hidden(critical_stiffness(rigid), rigid, rigid.etfe, (), (), prior)
    assert made is not None
    one = made[1]
    found, rows = all_together([one] * 8, [None] * 8)
    for name in ("extra_delay", "actuator_lag"):
        row = next(row for row in rows if row.name == name)
        own = next(w for w in one.looked.weighed if w.name == name).evidence
        assert own is not None and row.together is not None
        odds = 0.1 / 0.9 * float(own.weight @ np.exp(own.log + 7 * own.by_data))
        assert row.together == pytest.approx(odds / (1 + odds), rel=0.15, abs=0.01)
        assert row.strength_q95[1] < 0.6 * row.strength_q95[0]
    widths = [np.ptp(limit.db([0.01, 0.95])) for limit in (made[0], found[0][0])]
    assert widths[1] < widths[0]
    assert one.nothing < found[0][1].nothing


def test_a_study_tells_of_an_effect_what_the_recording_says_that_knows_most(
    rigid: Posterior,
) -> None:
    """One that sees only what the others exclude knows nothing, and less than nothing of sizes."""
    assert rigid.etfe is not None
    prior = HiddenPrior(0.0, {"extra_delay": 0.1})
    made = with_hidden(critical_stiffness(rigid), rigid, rigid.etfe, (), (), prior)
    assert made is not None
    fine = made[1]
    coarse = [
        replace(w, evidence=replace(w.evidence, size=1e4 * w.evidence.size), size=1e4 * w.size)
        for w in fine.looked.weighed
        if w.evidence is not None
    ]
    blunt = replace(
        fine,
        looked=replace(fine.looked, weighed=tuple(coarse)),
        effects=tuple(replace(e, strength_q95=1e4 * e.strength_q95) for e in fine.effects),
    )
    (row,) = all_together([fine, blunt], [None] * 2)[1]
    assert row.together is not None and row.together > 1e-3
    assert 0 < row.strength_q95[1] <= 1.1 * row.strength_q95[0]


def test_what_belongs_to_a_hand_or_a_configuration_is_not_shared(rigid: Posterior) -> None:
    assert rigid.etfe is not None
    prior = HiddenPrior(0.0, {"second_mode": 0.1, "extra_delay": 0.1})
    made = with_hidden(critical_stiffness(rigid), rigid, rigid.etfe, (), (), prior)
    assert made is not None
    rows = {row.name: row for row in all_together([made[1]] * 2, [0.0, 1.0])[1]}
    assert rows["second_mode"].together is None and rows["extra_delay"].together is not None
    rows = {row.name: row for row in all_together([made[1]] * 2, [0.0, 0.0])[1]}
    assert rows["second_mode"].together is not None


@pytest.fixture(scope="module")
def lagging() -> tuple[Bench, Closed]:
    """A held PHANToM with a lag that no test sees."""
    bench = Bench.from_device("phantom", held=True)
    bench = bench.with_effect("actuator_lag", time_constant_s=15e-6)
    noise = usual_noise(bench, 10.0)
    recording = recorded_on(bench, noise, seed=6)
    return bench, close_loop(recording, "grasped", device="phantom")


def test_a_lag_that_no_test_sees_is_allowed_for(lagging: tuple[Bench, Closed]) -> None:
    """The declared interval lies beside the truth, on the unsafe side."""
    bench, closed = lagging
    assert closed.verdict == "consistent"
    truth, analysis = bench.true_critical_stiffness(), closed.analysis
    assert truth < analysis.declared.quantile(0.01)
    assert analysis.limit.quantile(0.05) < truth < analysis.limit.quantile(0.95)
    assert analysis.limit.safe(0.01) < truth
    assert analysis.hidden is not None and analysis.hidden.nothing < 0.5


def test_a_lag_is_allowed_for_where_the_noise_was_widened(lagging: tuple[Bench, Closed]) -> None:
    """What a misfit leaves may be what hides: of all limits these must not be the declared ones."""
    bench, closed = lagging
    louder = replace(closed.analysis, hidden=None, limit=closed.analysis.declared, noise_scale=1.4)
    found = with_average(replace(closed, analysis=louder), HiddenPrior(), Options()).analysis
    assert found.hidden is not None
    assert found.limit.quantile(0.05) < bench.true_critical_stiffness()


def test_what_is_likelier_than_not_is_said_beside_that_nothing_was_found(
    lagging: tuple[Bench, Closed],
) -> None:
    _, closed = lagging
    hidden = closed.analysis.hidden
    assert hidden is not None
    known = "The model as declared explains the recording to within its noise."
    (lag,) = (one for one in hidden.effects if one.name == "actuator_lag")
    likely = f"{known[:-1]}; an actuator lag is likely all the same (and allowed for: {moves(lag)}"
    for share, said in ((0.4, known), (0.9, f"{likely} of the limit).")):
        effects = tuple(
            replace(one, probability=share if one.name == "actuator_lag" else 0.1)
            for one in hidden.effects
        )
        analysis = replace(closed.analysis, hidden=replace(hidden, effects=effects))
        assert in_short(replace(closed, analysis=analysis)) == said


def test_a_report_survives_its_average(
    lagging: tuple[Bench, Closed], monkeypatch: pytest.MonkeyPatch
) -> None:
    _, closed = lagging
    exact = replace(closed.analysis, hidden=None, limit=closed.analysis.declared)

    def fail(*_: object) -> None:
        raise FloatingPointError("a draw is nowhere")

    monkeypatch.setattr("bayeshaptic.diagnosis.close_loop.with_hidden", fail)
    found = with_average(replace(closed, analysis=exact), HiddenPrior(), Options())
    assert found.analysis.limit is exact.limit and found.analysis.hidden is None
    assert "a draw is nowhere" in found.analysis.notices[-1].text
    assert headline(found).status == "caution" and headline(found).stiffness is not None


@pytest.mark.parametrize(
    ("name", "slope"),
    [
        ("coulomb_friction", -np.sqrt(2 / np.pi)),
        ("cubic_damping", -3.0),
        ("damping_along_the_way", -1.0),
    ],
)
def test_a_force_stands_in_the_fit_as_its_describing_function(name: str, slope: float) -> None:
    shape = effect_class(name).tests[0]
    assert slope_of(shape) == pytest.approx(slope, rel=0.02)


def test_what_a_test_says_of_a_strength_is_its_likelihood() -> None:
    seen = ForceSaid(0.3, 0.1)
    strength = np.array([0.0, 0.3, 0.6])
    assert seen.log_likelihood(strength) == pytest.approx([0.0, 4.5, 0.0])


def test_what_a_law_leaves_is_no_evidence_of_another_force() -> None:
    model = build_model("rigid", "lhifam")
    seen = residual.ForceSeen(0.3, 0.03, 1.0)
    clean = residual.Test("sign(v)", "nonlinear", 10.0, two_sided(), None, "", seen)
    after = replace(clean, threshold=5 * two_sided())
    said = [force_suspects(model, [test], (), 1.0)[0].tested for test in (clean, after)]
    assert [one.log_likelihood(np.array([0.3]))[0] for one in said if one] == pytest.approx([50, 2])


def test_probabilities_of_a_study(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("time_s,force_n,position_m\n")
    text = '[device]\nname = "lhifam"\n[effects]\nextra_delay = {p}\neach = 0.01\n'
    file = tmp_path / "study.toml"
    file.write_text(text.format(p=0.3) + '[[recording]]\nfile = "a.csv"\n')
    prior = HiddenPrior.from_table(read_study(file).effects)
    assert prior.of("extra_delay") == 0.3 and prior.of("reflex") == 0.01
    assert prior.times(2.0).of("extra_delay") == 0.5
    file.write_text(text.format(p=1.5) + '[[recording]]\nfile = "a.csv"\n')
    with pytest.raises(InputError, match="extra_delay.*probability"):
        read_study(file)
    with pytest.raises(InputError, match="did you mean 'extra_delay'"):
        HiddenPrior.from_table({"extra_dela": 0.1})


def test_a_lossy_transmission_without_any_alias_to_sum_sums_none() -> None:
    """Steps may go so far on their way that the series begins behind the last one."""
    model = replace(build_model("free", "lhifam"), period_s=1e-3)
    loss = effect_class("structural_damping").candidates(model, fake_analysis("free").etfe)[0]
    full = model.with_effect(loss)
    values = dict(model.reference) | {"loss_factor": 0.1}
    system = full.system(np.array([values[name] for name in full.names]))
    none = alias_sums(system.remainder, np.linspace(0.1, 1.0, 16), system.delay_s, 1e-3, 9)
    assert none.shape == (16, 1) and np.all(none == 0)
