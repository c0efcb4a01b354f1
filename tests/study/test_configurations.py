"""Configurations: a device along a coordinate, and a study's cases and numbers."""

from __future__ import annotations

import json
import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from fake_analysis import fake_analysis
from scipy.stats import multivariate_normal
from toy_study import toy_model, toy_posterior

import bayeshaptic as bh
from bayeshaptic.diagnosis.analysis import Analysis
from bayeshaptic.errors import InputError
from bayeshaptic.faq import explained
from bayeshaptic.inference.population import settling
from bayeshaptic.inference.population.configurations import Configurations, infer_configurations
from bayeshaptic.inference.population.gaussian_likelihood import gaussian_likelihood
from bayeshaptic.inference.population.infer import prior_moments, study_coordinates
from bayeshaptic.inference.population.trend import Trend
from bayeshaptic.inference.posterior import Posterior
from bayeshaptic.recordings.study import Study, StudyEntry
from bayeshaptic.report.study.population_json import population_json
from bayeshaptic.report.study.words import people
from bayeshaptic.study.analysed import Analysed
from bayeshaptic.study.analysis import StudyAnalysis
from bayeshaptic.study.cases import study_cases
from bayeshaptic.study.configuration_limits import configuration_limits
from bayeshaptic.types import Floats

PLACES = (0.0, 0.2, 0.5, 0.7, 1.0)
KEYS = (
    "device", "recordings", "recommendation", "users", "population", "correlation", "new_person",
    "configurations", "device_limit", "sampling", "hidden_effects",
)  # fmt: skip


def along(places: tuple[float, ...], bend: float = 0.0) -> list[Posterior]:
    """Recordings of a device whose kc rises by 20 % along the coordinate, m2 by 5 %."""
    model = toy_model("kc", "m2", "b1", base="free")
    mean, _ = prior_moments(model, study_coordinates(model))
    names = list(model.names)
    noise = np.diag([1e-6, 1e-6, 1e-6])
    rng = np.random.default_rng(5)
    posteriors = []
    for number, place in enumerate(places):
        peak = mean.copy()
        peak[names.index("b1")] = 0.3
        peak[names.index("kc")] += 0.2 * place + bend * (place - 0.5) ** 2
        peak[names.index("m2")] += 0.05 * place
        peak += rng.multivariate_normal(np.zeros(3), noise)
        posteriors.append(toy_posterior(model, peak, noise, number))
    return posteriors


@pytest.fixture(scope="module")
def inferred() -> Configurations:
    return infer_configurations(along(PLACES), PLACES, seed=1)


def dense(line: Trend, phi: Floats) -> tuple[Floats, Floats]:
    """Covariance of all recordings' peaks, and of the path below them, built block by block."""
    size = len(line.hand)
    amplitude, scatter, length = np.exp(phi[:size]), np.exp(phi[size:-1]), np.exp(phi[-1])
    middle, half = 0.5 * (min(line.coordinate) + max(line.coordinate)), 0.5 * line.range
    count = len(line.coordinate)
    path = np.zeros((count, size, count, size))
    noise = np.zeros_like(path)
    for r, one in enumerate(line.coordinate):
        for q, other in enumerate(line.coordinate):
            gap = np.sqrt(5) * abs(one - other) / line.range / length
            bend = amplitude**2 * (1 + gap + gap**2 / 3) * np.exp(-gap)
            slope = 0.3**2 * (one - middle) / half * (other - middle) / half
            path[r, :, q] = np.diag(line.prior_sd**2 + slope + bend)
        noise[r, :, r] = line.likelihoods[r].covariance + np.diag(scatter**2)
    return tuple(part.reshape(count * size, -1) for part in (path + noise, path))  # type: ignore[return-value]


@pytest.fixture(scope="module")
def repeated() -> Trend:
    """Described recordings, several of them in one configuration."""
    places = (0.0, 0.5, 0.5, 1.0, 0.5, 1.0)
    line = infer_configurations(along(places), places, seed=1)._path
    assert isinstance(line, Trend)
    return line


def test_density_against_scipy(repeated: Trend) -> None:
    middle, width = repeated.guess()
    phi = middle + width * np.random.default_rng(1).standard_normal((4, len(middle)))
    expected = []
    for one in phi:
        prior = multivariate_normal(middle, np.diag(width**2)).logpdf(one)
        whole, _ = dense(repeated, one)
        expected.append(prior + multivariate_normal(cov=whole).logpdf(repeated.mean.ravel()))
    found = repeated.log_density(phi)
    np.testing.assert_allclose(found - found[0], np.array(expected) - expected[0], atol=1e-6)


def test_expected_recordings_against_conditioning(repeated: Trend) -> None:
    phi = repeated.guess()[0]
    whole, path = dense(repeated, phi)
    count, size = repeated.mean.shape
    own = path + np.diag(np.tile(np.exp(phi[size:-1]) ** 2, count))  # of the recordings' devices
    mean = own @ np.linalg.solve(whole, repeated.mean.ravel())
    covariance = own - own @ np.linalg.solve(whole, own)
    found, spread = repeated.expected(phi)
    np.testing.assert_allclose(found - repeated.prior_mean, mean.reshape(count, size), atol=1e-9)
    blocks = covariance.reshape(count, size, count, size)
    for r in range(count):
        np.testing.assert_allclose(spread[r], blocks[r, :, r], atol=1e-10)


def test_drawn_paths_against_conditioning(repeated: Trend) -> None:
    phi = repeated.guess()[0]
    whole, path = dense(repeated, phi)
    size = len(repeated.hand)
    mean = (path @ np.linalg.solve(whole, repeated.mean.ravel()))[:size] + repeated.prior_mean
    left = (path - path @ np.linalg.solve(whole, path))[:size, :size]
    sd = np.sqrt(np.diag(left) + np.exp(phi[size:-1]) ** 2)
    drawn = repeated.draw(np.tile(phi, (4000, 1)), np.zeros(1), np.random.default_rng(3))[:, 0]
    assert np.all(np.abs(drawn.mean(axis=0) - mean) < 4 * sd / np.sqrt(4000))
    np.testing.assert_allclose(drawn.std(axis=0), sd, rtol=0.06)


def test_between_measured_configurations(inferred: Configurations) -> None:
    grid = inferred.grid(9)
    assert set(PLACES) <= set(grid) and np.all(np.diff(grid) > 0) and len(grid) >= 9
    draws = inferred.predict(grid, np.random.default_rng(2), 600)
    kc = np.log(draws[:, :, inferred.model.names.index("kc")])
    truth = np.log(inferred.model.reference["kc"]) + 0.2 * grid
    off = np.abs(np.median(kc, axis=0) - truth)
    assert np.all(off < 0.01)  # of 20 % along the coordinate
    low, high = np.quantile(kc, [0.05, 0.95], axis=0)
    assert np.all((low < truth) & (truth < high)) and np.all(high - low < 0.06)
    assert np.all(draws > 0)


def test_two_configurations_are_not_a_path() -> None:
    with pytest.raises(InputError, match="2 different configurations"):
        infer_configurations(along((0.0, 1.0)), (0.0, 1.0))
    with pytest.raises(InputError, match="1 posteriors, but 2 configurations"):
        infer_configurations(along((0.0,)), (0.0, 1.0))


def test_a_recording_that_is_described_where_it_is_not_makes_no_path() -> None:
    """One that left several peaks: masses of 1e61 kg followed, at the measured place, too."""
    posteriors = along(PLACES)
    strange = posteriors[2]
    x = study_coordinates(strange.model).coordinate(strange.draws)
    off = (x - x.mean(axis=0)) / x.std(axis=0) - 60
    likelihood = -0.5 * np.sum(off**2, axis=1).reshape(strange.log_likelihood.shape)
    posteriors[2] = replace(strange, log_likelihood=likelihood)
    with pytest.raises(InputError, match="configuration 0.5 leaves too much open"):
        infer_configurations(posteriors, PLACES, seed=1)


def test_a_recording_whose_description_ran_off_keeps_its_own(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """One person's hand, 9 of its errors away, left the example study without held configurations:
    people did with the description over its own draws, and configurations did not."""
    posteriors = along(PLACES)
    plain = infer_configurations(posteriors, PLACES, seed=1)
    own = gaussian_likelihood(posteriors[2], study_coordinates(plain.model, posteriors))
    gone = replace(own, mean=own.mean + 60 * np.sqrt(np.diag(own.covariance)))
    monkeypatch.setattr(
        settling, "linearised", lambda one, *_: gone if one is posteriors[2] else None
    )
    found = infer_configurations(posteriors, PLACES, seed=1)
    place, rng = np.array([0.5]), np.random.default_rng(3)
    number = plain.model.names.index("kc")
    was, now = (np.log(one.predict(place, rng, 400)[:, 0, number]) for one in (plain, found))
    assert abs(np.median(now) - np.median(was)) < 0.5 * was.std()


def test_the_worst_configuration() -> None:
    # The limit of the free PHANToM is that of its damping: let that fall to one end.
    posteriors = []
    model = toy_model("m2", "b1", base="free")
    mean, _ = prior_moments(model, study_coordinates(model))
    names = list(model.names)
    for number, place in enumerate(PLACES):
        peak = mean.copy()
        peak[names.index("b1")] = 0.5 - 0.2 * place
        posteriors.append(toy_posterior(model, peak, 1e-6 * np.eye(2), number))
    found = configuration_limits(posteriors, PLACES, held=False)
    assert found.worst_coordinate == 1.0 and found.worst_probability[-1] > 0.9
    assert found.worst_probability.sum() == pytest.approx(1.0)
    middle = found.quantile(0.5)
    assert np.all(np.diff(middle) < 0)
    assert [case.joint for case in found.cases] == ["along, nobody holds it"] * len(
        found.coordinates
    )


def analysed(name: str, posterior: Posterior, **entry: object) -> Analysed:
    """A recording with the given posterior; the rest of its analysis is invented."""
    fake = fake_analysis("free", "phantom")
    limit = bh.critical_stiffness(posterior)
    keys = Analysis.__dataclass_fields__
    parts = {key: getattr(fake, key) for key in keys} | {
        "posterior": posterior, "model": posterior.model, "limit": limit
    }  # fmt: skip
    return Analysed(name, StudyEntry(Path(f"{name}.csv"), **entry), Analysis(**parts))  # type: ignore[arg-type]


def whole_study(recordings: list[Analysed]) -> StudyAnalysis:
    cases = study_cases(recordings, 0, lambda share, word: None)
    device = bh.load_device("phantom")
    study = Study("toy", Path("toy.toml"), device, tuple(one.entry for one in recordings))
    names = ("population", "new_person", "users", "configurations", "cases", "limit")
    parts = {name: getattr(cases, name) for name in names}
    return StudyAnalysis(
        study, device, tuple(recordings), notices=cases.notices, seconds=cases.seconds, **parts
    )


@pytest.fixture(scope="module")
def mixed() -> StudyAnalysis:
    """Free in five configurations, and three users, one of them with another model."""
    free = [
        analysed(f"free-{n}", one, configuration=place)
        for n, (one, place) in enumerate(zip(along(PLACES), PLACES, strict=True))
    ]
    model, odd = toy_model("kc", "kh"), toy_model("kc", "mh")
    mean, _ = prior_moments(model, study_coordinates(model))
    users = [
        analysed(f"u-{n}", toy_posterior(model, mean + 0.1 * n, 1e-4 * np.eye(2), n), user=f"u{n}")
        for n in range(3)
    ]
    other, _ = prior_moments(odd, study_coordinates(odd))
    users.append(analysed("odd", toy_posterior(odd, other, 1e-4 * np.eye(2), 9), user="odd"))
    failed = Analysed("bad", StudyEntry(Path("bad.csv"), user="h"), None, "bad.csv: no data")
    return whole_study([*free, *users, failed])


def test_cases_of_a_study(mixed: StudyAnalysis) -> None:
    labels = [case.label for case in mixed.cases]
    assert labels[:4] == ["user u0", "user u1", "user u2", "user odd"]
    assert labels[4] == "a new person"
    assert "configuration 0.2, nobody holds it" in labels
    assert any("(predicted)" in label for label in labels)
    assert mixed.population is not None and mixed.population.users == ("u0", "u1", "u2")
    held = [one for one in mixed.recordings if one.entry.user]
    held[3] = replace(held[3], entry=replace(held[3].entry, user="u0"))  # in it but for this one
    again = study_cases(held, 0, lambda share, word: None).cases
    assert [case.label for case in again][::3] == ["user u0", "user u0 (odd)"]
    assert any("Left out" in one.text and "odd" in one.text for one in mixed.notices)
    assert mixed.limit is not None
    # Free, the PHANToM is far worse than held; and that comes out by itself.
    assert mixed.limit.binding[0].group == "configuration"
    assert mixed.limit.by_group()["held"] < 0.01
    assert mixed.new_person[0].limit.chains == mixed.population.walkers > 1
    assert pickle.loads(pickle.dumps(mixed)).cases[0].label == "user u0"


def test_numbers_of_a_study(mixed: StudyAnalysis) -> None:
    found = json.loads(population_json(mixed))
    assert tuple(found) == KEYS
    assert found["device"] == "phantom" and found["recordings"] == 9
    assert [row["user"] for row in found["users"]] == ["u0", "u1", "u2", "odd"]
    assert list(found["population"]) == ["kh"]
    assert found["population"]["kh"].keys() == {"log_mean", "log_sd"}
    assert found["population"]["kh"]["log_sd"].keys() == {"q05", "q50", "q95"}
    assert found["correlation"] == [[pytest.approx(1.0)]]
    new = found["new_person"]["critical_stiffness"]
    assert new.keys() == {"unit", "q05", "q50", "q95", "db", "safe", "crossings"}
    assert new["q05"] < new["q50"] < new["q95"] and new["unit"] == "N m/rad"
    assert new["safe"].keys() == {"0.05", "0.01", "0.001"}
    assert found["sampling"]["converged"] and found["sampling"]["rhat_max"] < 1.01
    assert found["sampling"]["ess_min"] > 500 and found["sampling"]["not_pooled"] == []
    rows = found["configurations"]
    assert {row["coordinate"] for row in rows} >= set(PLACES) and not any(r["held"] for r in rows)
    assert found["device_limit"]["binding"][0].keys() == {"case", "probability"}


def test_named_configurations_are_cases_and_nothing_between() -> None:
    found = whole_study(
        [
            analysed(name, one, configuration=name, trial=trial)
            for name, one, trial in zip("aab", along((0.0, 0.0, 1.0)), (1, 2, 1), strict=True)
        ]
    )
    assert found.configurations == () and found.population is None
    assert [c.label for c in found.cases] == [f"nobody holds it, configuration {n}" for n in "ab"]
    assert len(found.cases[0].draws) == 2 * len(found.cases[1].draws)
    numbers = json.loads(population_json(found))
    assert numbers["population"] is None and numbers["new_person"] is None
    assert [row["coordinate"] for row in numbers["configurations"]] == ["a", "b"]


def test_a_new_person_is_where_most_people_were() -> None:
    model = toy_model("kc", "kh")
    mean, _ = prior_moments(model, study_coordinates(model))
    found = whole_study(
        [
            analysed(
                f"u-{n}",
                toy_posterior(model, mean + 0.1 * n, 1e-4 * np.eye(2), n),
                user=f"u{n}",
                configuration=place,
            )
            for n, place in enumerate((0.0, 0.5, 0.5))
        ]
    )
    labels = [case.label for case in found.new_person]
    assert labels == ["a new person, configuration 0.5", "a new person, configuration 0"]
    new = json.loads(population_json(found))["new_person"]
    assert new["configuration"] == 0.5
    assert [row["configuration"] for row in new["by_configuration"]] == [0.5, 0.0]
    first = found.new_person[0].limit
    assert new["critical_stiffness"]["q50"] == pytest.approx(first.quantile(0.5))
    assert new["critical_stiffness"]["safe"]["0.01"] == pytest.approx(first.safe(0.01))
    words = " ".join(people(found))
    assert "(in configuration 0.5)" in words and "in configuration 0." in words


def test_a_limit_is_that_of_its_recordings_period() -> None:
    """The population's had been the first one's, for a recording of twice the period, too."""
    model = toy_model("kc", "kh")
    mean, _ = prior_moments(model, study_coordinates(model))
    users = [
        analysed(f"u-{n}", toy_posterior(one, mean, 1e-4 * np.eye(2), n), user=f"u{n}")
        for n, one in enumerate((model, model, replace(model, period_s=2e-3)))
    ]
    found = study_cases(users, 0, lambda share, word: None)
    assert found.population is not None and found.population.users == ("u0", "u1")
    own = users[2].analysis
    assert own is not None
    (slow,) = [case for case in found.cases if case.label == "user u2"]
    assert slow.limit.quantile(0.5) == pytest.approx(own.limit.quantile(0.5), rel=0.01)
    several, odd, *_ = (notice.text for notice in found.notices)
    assert "several periods: 1.00 ms, 2.00 ms" in several
    assert "u-2 (no effect, 2.00 ms)" in odd


@pytest.mark.parametrize("user", [None, "h"])
def test_what_could_not_be_made_is_explained(
    monkeypatch: pytest.MonkeyPatch, user: str | None
) -> None:
    """The report of a study ended with "no entry 'configurations (free)'"."""

    def refused(*arguments: object) -> None:
        raise InputError("too much is open")

    monkeypatch.setattr("bayeshaptic.study.cases.configuration_limits", refused)
    model = toy_model("kc", "kh") if user else toy_model("kc", "m2", "b1", base="free")
    mean, _ = prior_moments(model, study_coordinates(model))
    posteriors = [toy_posterior(model, mean, 1e-4 * np.eye(model.size), n) for n in range(3)]
    found = study_cases(
        [
            analysed(f"{n}", one, user=user, configuration=float(n))
            for n, one in enumerate(posteriors)
        ],
        0,
        lambda share, word: None,
    )
    told = [explained(notice) for notice in found.notices]
    assert any("too much is open" in one and "explain configurations" in one for one in told)


def test_nothing_left() -> None:
    failed = Analysed("bad", StudyEntry(Path("bad.csv")), None, "bad.csv: no data")
    found = whole_study([failed])
    assert found.limit is None and found.cases == () and found.failed == (failed,)
    numbers = json.loads(population_json(found))
    assert tuple(numbers) == KEYS and numbers["device_limit"] is None and numbers["users"] == []


def test_a_recording_that_fails_stops_nothing(tmp_path: Path) -> None:
    (tmp_path / "bad.csv").write_text("time_s,force_n\n0,1\n", encoding="utf-8")
    (tmp_path / "study.toml").write_text(
        '[device]\nname = "phantom"\n[[recording]]\nfile = "bad.csv"\nuser = "h"\n',
        encoding="utf-8",
    )
    said: list[str] = []
    study = bh.read_study(tmp_path / "study.toml")
    found = bh.analyse_study(study, progress=lambda share, word: said.append(word))
    assert found.limit is None and "no column" in str(found.recordings[0].error)
    assert any(one.topic == "recordings" for one in found.notices) and said[-1] == "done"
    assert replace(found.recordings[0], error=None).effects == ()
