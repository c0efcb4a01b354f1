"""The report: the sentence, the words, the page, the files."""

from __future__ import annotations

import base64
import hashlib
import html
import json
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from browser import needs_browser, probe, run
from fake_analysis import CASES, FEEDBACK, FakeAnalysis, fake_analysis, fake_closed

import bayeshaptic
from bayeshaptic.devices import load_device
from bayeshaptic.errors import InputError, Notice
from bayeshaptic.quantities import interval
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.report import write, write_report
from bayeshaptic.report.figures.pictures import PICTURES, draw_pictures
from bayeshaptic.report.figures.style import Drawn
from bayeshaptic.report.headline import headline
from bayeshaptic.report.numbers.estimates import least_squares_limit, witnesses
from bayeshaptic.report.objections import why_none
from bayeshaptic.report.page.answer import FARED, FARED_HIDDEN
from bayeshaptic.report.page.frame import template
from bayeshaptic.report.page.lights import lights
from bayeshaptic.report.page.methods import bibtex, methods
from bayeshaptic.report.page.next_step import next_steps
from bayeshaptic.report.tables import comparison, parameters, safe
from bayeshaptic.report.words import agreement, delay, hump, misfit, response_caption

WALLS = ("limits_curve", "limits_kb", "guidance_shares", "guidance_sweeps")
NAMES = (*(picture.name for picture in PICTURES), *WALLS)
TABLES = {"summary.json", "limits.json", "limits.csv"}
FILES = {"report.html", "posterior.nc", *TABLES, *(f"{name}.png" for name in NAMES)}


# ---- the sentence


def test_the_recommendation_is_never_above_the_safe_stiffness() -> None:
    for seed in range(8):
        analysis = fake_analysis("rigid", spread=0.002, seed=seed)
        found = headline(analysis)
        assert found.status == "safe"
        number = re.search(r"at most ([\d.]+) kN/m", found.sentence)
        assert number, found.sentence
        exact = analysis.limit.safe(0.01)
        assert 0.98 * exact < 1e3 * float(number[1]) <= exact
        assert "1 %" in found.sentence


def test_both_humps_are_named() -> None:
    analysis = fake_analysis(**CASES["two-humps"])
    details = " ".join(headline(analysis).details)
    for crossing in analysis.limit.crossings:
        assert crossing.label in details
    assert len(analysis.limit.crossings) == 2
    assert "More than one crossing" in hump(analysis)
    assert hump(fake_analysis("rigid")) == ""


def test_a_mass_at_a_bound_is_no_reason_to_say_a_delay_that_was_said() -> None:
    analysis = fake_analysis("free")
    fit = replace(analysis.fit, outcome={**analysis.fit.outcome, "m2": "at a bound"})
    told = bayeshaptic.free(device="lhifam")
    assert "delay_s" in analysis.model.names and "delay_s" not in told.names
    for model, words in (
        (told, "say --modes and --held"),
        (analysis.model, "say the loop's delay"),
    ):
        said = " ".join(why_none(FakeAnalysis(**vars(analysis) | {"fit": fit, "model": model})))
        assert "ends at a bound (m2), where no device is: " in said and words in said


def test_no_confident_number_when_the_model_does_not_explain_the_data() -> None:
    found = headline(fake_analysis("rigid", misfit=13.0))
    assert found.status == "untrusted"
    assert "does not explain the data" in found.sentence
    assert "13 times the noise" in found.sentence
    assert "N/m" not in found.sentence
    assert "not to be trusted" in " ".join(found.details)


def test_a_faint_misfit_is_said_beside_the_number() -> None:
    analysis = fake_analysis("rigid")
    analysis.fit = replace(analysis.fit, reduced_chi_square=1.25, residual=np.ones(400, complex))
    found = headline(analysis)
    assert found.status == "caution"
    assert "slightly above the noise" in " ".join(found.details)


def test_few_points_may_be_above_the_noise_by_chance() -> None:
    analysis = fake_analysis("rigid")
    analysis.fit = replace(analysis.fit, reduced_chi_square=1.4, residual=np.ones(12, complex))
    assert headline(analysis).status == "safe"


@pytest.mark.parametrize(
    ("case", "words"), [("feedback", "feedback"), ("not-converged", "not converged")]
)
def test_the_sentence_carries_what_spoils_it(case: str, words: str) -> None:
    found = headline(fake_analysis(**CASES[case]))
    assert found.status == "untrusted"
    assert words in found.sentence


def test_a_warning_stands_beside_the_number() -> None:
    notice = Notice("warning", "resolution", "The encoder is ten times coarser than declared")
    found = headline(fake_analysis("rigid", notices=(notice,)))
    assert found.status == "caution"
    assert notice.text in found.details[-1]
    note = Notice("note", "band", "Band 0.7 to 300 Hz.")
    assert headline(fake_analysis("rigid", notices=(note,))).status == "safe"


def test_a_measurement_that_contradicts_the_model_lowers_the_number() -> None:
    analysis = fake_analysis()
    low = 0.8 * analysis.limit.quantile(0.5)
    own = {"q05": 0.98 * low, "q50": low, "q95": 1.02 * low}
    analysis.etfe_limit = replace(analysis.etfe_limit, **own)
    found = headline(analysis)
    assert found.status == "caution"
    number = re.search(r"Stay below ([\d.]+) kN/m", found.sentence)
    assert number
    assert 0.97 * low < 1e3 * float(number[1]) <= 0.98 * low
    assert "do not overlap" in agreement(analysis)
    wide = {"q05": 0.5 * low, "q95": 2 * low}
    analysis.etfe_limit = replace(analysis.etfe_limit, **wide)
    assert (
        "Near 8.70 Hz the phase is known to 0.03 degrees (sd), and each tenth of a degree moves "
        "this limit by 1.2 dB." in agreement(analysis)
    )


def test_an_unstable_or_unlimited_loop_gets_no_number() -> None:
    analysis = fake_analysis("rigid")
    samples = analysis.limit.samples.copy()
    samples[: len(samples) // 10] = 0.0
    analysis.limit = replace(analysis.limit, samples=samples)
    found = headline(analysis)
    assert found.status == "untrusted"
    assert "10 %" in found.sentence
    analysis.limit = replace(analysis.limit, samples=np.full_like(samples, np.inf))
    assert "Nothing limits" in headline(analysis).sentence


def test_too_few_draws_are_no_recommendation() -> None:
    analysis = fake_analysis("rigid")
    few = slice(0, 100)
    limit = analysis.limit
    analysis.limit = replace(
        limit,
        samples=limit.samples[few],
        frequency_hz=limit.frequency_hz[few],
        group=limit.group[few],
        chains=1,
    )
    assert "too few" in headline(analysis).sentence


def test_an_unexplained_remainder_is_said() -> None:
    closed = fake_closed("unexplained", "linear")
    found = headline(closed)
    assert found.status == "caution"
    assert "unexplained" in found.sentence


# ---- words and tables


def test_the_misfit_is_placed() -> None:
    analysis = fake_analysis("rigid", misfit=8.0)  # the stand-in's residual sits around 80 Hz
    text = misfit(analysis)
    assert "8 times the noise" in text
    hertz = re.search(r"around ([\d.]+) Hz", text)
    assert hertz and 55 < float(hertz[1]) < 115


def test_remarks_of_the_parameter_table() -> None:
    analysis = fake_analysis("free", damping=1.0)
    rows = {row.name: row for row in parameters(analysis)}
    assert "bound" in rows["b2"].remarks and "±" not in rows["b2"].least_squares
    dominated = [name for name, yes in analysis.posterior.prior_dominated.items() if yes]
    assert dominated
    assert all("the prior decides" in rows[name].remarks for name in dominated)
    assert "±" in rows["kc"].least_squares and rows["kc"].unit == "kN/m"
    assert rows["delay_s"].unit == "µs"


def test_the_safe_table_has_a_tip_only_where_there_is_one() -> None:
    assert {len(row) for row in safe(fake_analysis("rigid"))} == {3}
    tipped = safe(fake_analysis("rigid", device="phantom", lever_m=0.12))
    assert tipped[0][3].endswith("N/m")


def test_witnesses_stand_side_by_side() -> None:
    analysis = fake_analysis("rigid")
    found = {witness.key: witness for witness in witnesses(analysis)}
    assert list(found) == ["posterior", "least_squares", "etfe", "rigid_rule", "passivity"]
    # Diaz and Gil's rule is the limit of a rigid device to a few per cent.
    assert found["rigid_rule"].middle == pytest.approx(found["posterior"].middle, rel=0.05)
    assert found["least_squares"].middle == least_squares_limit(analysis)
    silent = fake_analysis("rigid", etfe_limit=False)
    assert "etfe" not in {witness.key for witness in witnesses(silent)}
    assert "does not reach" in agreement(silent)


# ---- the files


@pytest.fixture(scope="module")
def some_pictures() -> dict[str, Drawn]:
    return draw_pictures(fake_analysis("rigid"))


@pytest.fixture
def drawn_once(monkeypatch: pytest.MonkeyPatch, some_pictures: dict[str, Drawn]) -> None:
    """Reports with pictures from the shelf, for the tests that do not look at them."""
    monkeypatch.setattr(write, "draw_pictures", lambda analysis: some_pictures)


def written(analysis: Any, folder: Path) -> Path:
    page = write_report(analysis, folder)
    assert page == folder.resolve() / "report.html"
    return page


@pytest.mark.usefixtures("drawn_once")
def test_everything_is_written_and_nothing_else(tmp_path: Path) -> None:
    page = written(fake_analysis("rigid"), tmp_path / "deep" / "out")
    assert {path.name for path in page.parent.iterdir()} == FILES
    assert [path.name for path in page.parent.parent.iterdir()] == ["out"]
    assert json.loads((page.parent / "summary.json").read_text(encoding="utf-8"))["version"]


@pytest.mark.usefixtures("drawn_once")
def test_a_second_report_replaces_the_first_and_leaves_other_files(tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("mine")
    written(fake_analysis("rigid"), tmp_path)
    written(fake_analysis("rigid", title="another.csv", device=None), tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == FILES | {"mine.txt"}
    assert "another.csv" in (tmp_path / "report.html").read_text(encoding="utf-8")


@pytest.mark.usefixtures("drawn_once")
@pytest.mark.parametrize("there", [True, False], ids=["over an older report", "new"])
@pytest.mark.parametrize("error", [KeyboardInterrupt, OSError("disk full")])
def test_an_interrupted_report_leaves_nothing_half_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, there: bool, error: Any
) -> None:
    out = tmp_path / "out"
    analysis = fake_analysis("rigid")
    before = {}
    if there:
        written(analysis, out)
        before = {path.name: path.read_bytes() for path in out.iterdir()}

    def fail(*_: Any) -> str:
        raise error

    monkeypatch.setattr(write, "summary_json", fail)
    with pytest.raises(type(error) if isinstance(error, OSError) else error):
        write_report(fake_analysis("free"), out)
    assert out.exists() == there
    if there:
        assert {path.name: path.read_bytes() for path in out.iterdir()} == before
    assert [path.name for path in tmp_path.iterdir()] == (["out"] if there else [])


@pytest.mark.usefixtures("drawn_once")
def test_a_file_is_not_a_folder(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("a file")
    with pytest.raises(InputError, match="is a file; name a folder"):
        write_report(fake_analysis("rigid"), tmp_path / "out")


def test_a_real_analysis_makes_a_whole_report(tmp_path: Path) -> None:
    data = Path(__file__).parents[2] / "data" / "recordings" / "phantom-free.csv.gz"
    recording = bayeshaptic.read_recording(data)
    analysis = bayeshaptic.analyse(recording, model="free", device="phantom", ess=400)
    page = written(analysis, tmp_path / "out")
    found = json.loads((page.parent / "summary.json").read_text(encoding="utf-8"))
    limit = found["critical_stiffness"]
    # The published PHANToM, to the uncertainty of one recording of 30 s.
    assert limit["db"]["q50"] == pytest.approx(22.42, abs=0.1)
    assert limit["tip"]["q50"] == pytest.approx(limit["q50"] / 0.12**2, rel=1e-9)
    assert found["recording"]["file"] == data.as_posix()
    assert found["recording"]["samples"] == 30_000
    saved = bayeshaptic.load_posterior(page.parent / "posterior.nc")
    again = bayeshaptic.critical_stiffness(saved)
    assert again.quantile(0.5) == pytest.approx(limit["q50"], rel=1e-9)
    text = page.read_text(encoding="utf-8")
    assert headline(analysis).sentence in html.unescape(text).replace("\xa0", " ")
    assert "rigid body at 17" in text
    assert hashlib.sha256(data.read_bytes()).hexdigest() in text


# ---- the page


def test_the_page_is_one_light_file_that_needs_nothing_else(tmp_path: Path) -> None:
    other = replace(FEEDBACK, text="The model that was asked for is set aside.")
    page = written(fake_analysis(notices=(FEEDBACK, FEEDBACK, other)), tmp_path)
    text = page.read_text(encoding="utf-8")
    assert page.stat().st_size < 2_000_000
    assert "<link" not in text and "javascript:" not in text and "@import" not in text
    assert not re.findall(r'src="(?!data:image/png;base64,)', text)
    assert not re.findall(r"url\((?!#)", text)
    (script,) = re.findall(r"<script>(.*?)</script>", text, re.DOTALL)
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert f"style-src 'unsafe-inline'; script-src 'sha256-{digest}'" in text
    assert "default-src 'none'; img-src data:;" in text
    assert text.count(FEEDBACK.text) == text.count(other.text) == 1  # however often noticed
    notices = text[text.index('<section id="notices">') :]
    assert notices[: notices.index("</ul>")].count('class="explained"') == 1  # what a topic means
    for picture in PICTURES:
        assert f'aria-label="Figure: {picture.alternative}"' in html.unescape(text)


def test_every_link_leads_somewhere_and_no_name_is_there_twice(tmp_path: Path) -> None:
    text = written(fake_closed(), tmp_path).read_text(encoding="utf-8")
    names = re.findall(r'\sid="([^"]+)"', text)
    assert len(names) == len(set(names))
    links = re.findall(r'<a[^>]* href="([^"]+)"', text)
    assert len(links) > 20
    for link in links:
        known = link[1:] in names if link.startswith("#") else (tmp_path / link).is_file()
        assert known, link
    levels = [int(level) for level in re.findall(r"<h([1-6])", text)]
    assert levels[0] == 1 and levels.count(1) == 1
    assert all(after <= before + 1 for before, after in zip(levels, levels[1:], strict=False))


def test_the_figures_of_interval_coverage_are_those_of_the_benchmarks() -> None:
    readme = (Path(__file__).parents[2] / "benchmarks" / "README.md").read_text(encoding="utf-8")
    for row, verdict in (("promised effects", "explained"), ("others", "unexplained")):
        cells = re.search(rf"\| {row} \|(.*)\|", readme)
        assert cells
        numbers = [cell.strip(" %*") for cell in cells[1].split("|")]
        assert FARED[verdict][:2] == (int(numbers[-1]), int(numbers[0]))
    clean = re.search(r"\| all \| (\d+) \|.*?\|.*?\| \*\*(\d+) %\*\*", readme)
    assert clean and FARED["consistent"][:2] == (int(clean[2]), int(clean[1]))
    hidden = re.search(r"\| all \| (\d+) \|(?:[^|*]*\|){3} \*\*(\d+) %\*\*", readme)
    assert hidden and (int(hidden[2]), int(hidden[1])) == FARED_HIDDEN


@pytest.mark.parametrize(("sd", "refused"), [(0.3, False), (3.0, True)])
def test_a_limit_that_only_the_prior_ends_below_is_no_recommendation(
    sd: float, refused: bool
) -> None:
    # The limit of one mass goes with its damper: 2.3 sd below the median is half of it, or 1/1000.
    analysis = fake_analysis("rigid", damping=sd)
    found = headline(analysis)
    assert (found.stiffness is None) == ("how small" in found.sentence) == refused
    assert any("dampers" in step.text for step in next_steps(found, analysis)) == refused


def test_one_mass_that_does_not_explain_a_loop_is_taken_back() -> None:
    """It said to record again, of a loop that is read without that."""
    notice = Notice("warning", "feedback", "The force was computed from the motion (it was).")
    analysis = fake_analysis(notices=(notice,))
    _, other = next_steps(headline(analysis), analysis, {"options": {"model": "rigid"}})
    assert "one mass" in other.text and "--model" not in other.command


def test_the_next_command_reads_the_file_as_this_one_did() -> None:
    """It said no columns and no period, and was refused."""
    analysis = fake_analysis(converged=False)
    options = {"columns": "force=u[N],position=q[mm]", "period_s": 0.005, "held": False}
    (step,) = next_steps(headline(analysis), analysis, {"options": options})
    said = "--columns 'force=u[N],position=q[mm]' --period-s 0.005 --held no"
    assert step.command.endswith(f"{said} --seed {analysis.posterior.seed + 1}")


def test_what_was_taken_for_held_and_has_several_peaks_may_be_held_by_nobody() -> None:
    analysis = fake_analysis(converged=False)
    tried = {str(held): SimpleNamespace(held=held) for held in (True, False)}
    analysis.choice = SimpleNamespace(candidates=tried)
    (step,) = next_steps(headline(analysis), analysis)
    assert "nobody holds" in step.text and step.command.endswith("--held no")
    assert "--seed" in step.text  # for who does hold it


def test_units_that_nobody_said_are_on_the_first_screen() -> None:
    note = Notice("note", "units", "The force's unit is not given.", ("force",))
    found = headline(fake_analysis("rigid", notices=(note,)))
    assert found.stiffness is not None
    assert any(
        "N stands for whatever the command was recorded in" in text for text in found.details
    )
    assert not any("stands for" in text for text in headline(fake_analysis("rigid")).details)
    both = Notice("note", "units", "No units were given.", ("force", "position"))
    counts = Notice("warning", "units", "The positions are whole numbers.", ("position",))
    doubted = fake_analysis("rigid", None, notices=(both, counts))
    refused = headline(doubted)
    assert refused.status == "untrusted" and "nobody said the position's unit" in refused.sentence
    units, mass = next_steps(refused, doubted)
    assert "position=NAME*3.1e-6[m]" in units.command
    assert "--device MINE.toml" in mass.command and "[rigid] m =" in mass.text
    said = headline(fake_analysis("rigid", notices=(note, counts)))
    assert said.stiffness is None and "nobody said" not in said.sentence


def test_a_wall_that_no_device_renders_is_not_recommended() -> None:
    """Masses in a unit a thousand times too large had 21 MN/m recommended, in green."""
    usual = fake_analysis("rigid", None)
    limit = replace(usual.limit, samples=usual.limit.samples * 1e4)
    stiff = FakeAnalysis(**{**vars(usual), "limit": limit})
    assert headline(usual).stiffness is not None and stiff.limit.quantile(0.5) > 1e6
    refused = headline(stiff)
    assert refused.status == "untrusted" and "position (m) or of the force (N)" in refused.sentence
    assert any("--device" in step.command for step in next_steps(refused, stiff))
    confirmed = FakeAnalysis(**{**vars(stiff), "device": load_device("lhifam")})
    assert headline(confirmed).stiffness is not None


@pytest.mark.parametrize("case", CASES)
def test_a_page_without_a_recommendation_says_what_to_do(case: str) -> None:
    analysis = fake_analysis(**CASES[case])
    head = headline(analysis)
    assert bool(next_steps(head, analysis)) == (head.status == "untrusted")


@pytest.mark.parametrize(
    ("case", "states"),
    [
        ("grasped", ("good", "good", "doubt", "good")),
        ("feedback", ("bad", "good", "doubt", "good")),
        ("amperes", ("good", "bad", "doubt", "good")),
        ("not-converged", ("good", "good", "doubt", "bad")),
    ],
)
def test_the_lights(case: str, states: tuple[str, ...]) -> None:
    assert tuple(light.state for light in lights(fake_analysis(**CASES[case]))) == states


def test_the_methods_paragraph_is_of_this_run_and_has_its_references() -> None:
    analysis = fake_analysis()
    text = methods(analysis)
    assert "4 independent ensembles of 32 walkers" in text and "12 parameters" in text
    assert "discrepancy" not in text and "kennedy2001" not in bibtex(analysis)
    widened = fake_closed("unexplained")
    assert "kennedy2001" in methods(widened) and "kennedy2001" in bibtex(widened)
    for result in (analysis, widened):
        assert set(re.findall(r"\[(\w+)\]", methods(result))) == set(
            re.findall(r"@\w+{(\w+),", bibtex(result))
        )


@pytest.mark.usefixtures("drawn_once")
def test_names_from_files_cannot_become_markup(tmp_path: Path) -> None:
    page = written(fake_analysis("rigid", device=None, title="<b>x</b> & y.csv"), tmp_path)
    text = page.read_text(encoding="utf-8")
    assert "<b>x</b>" not in text
    assert "&lt;b&gt;x&lt;/b&gt; &amp; y.csv" in text


@pytest.mark.usefixtures("drawn_once")
def test_an_untrusted_page_calls_nothing_safe(tmp_path: Path) -> None:
    text = written(fake_analysis(**CASES["amperes"]), tmp_path).read_text(encoding="utf-8")
    visible = re.sub(r"<style>.*?</style>", "", text, flags=re.DOTALL)
    assert "Safe stiffness" not in visible
    assert "if the model were right" in visible
    assert "not to be relied on" in visible


@needs_browser
@pytest.mark.usefixtures("drawn_once")
@pytest.mark.parametrize("case", ["feedback", "phantom-tip"])
def test_the_page_in_a_browser(case: str, tmp_path: Path) -> None:
    page = written(fake_analysis(**CASES[case]), tmp_path / "out")
    count = len(NAMES) - (len(WALLS) if case == "feedback" else 0)  # no walls where none is safe
    for width in (1200, 520):
        found = probe(page, tmp_path, width)
        assert found["texts"] > 200
        assert found["overlaps"] == []
        assert found["width"] <= found["window"], "the page scrolls sideways"
        assert all(name.startswith("data:") for name in found["requests"])
        assert len(found["images"]) == count
        assert all(natural > 250 for _, natural, _ in found["images"])
        # Folded away: residual and sampler; one of the two bars. A phone scrolls figures sideways.
        assert sum(shown > 0 for *_, shown in found["images"]) >= count - 3


@needs_browser
@pytest.mark.usefixtures("drawn_once")
def test_the_page_as_a_picture_and_on_paper(tmp_path: Path) -> None:
    from matplotlib.image import imread

    page = written(fake_analysis("rigid"), tmp_path / "out")
    shot, paper = tmp_path / "page.png", tmp_path / "page.pdf"
    run(tmp_path, "--window-size=1200,1600", f"--screenshot={shot}", page.as_uri())
    run(tmp_path, f"--print-to-pdf={paper}", page.as_uri())
    picture = imread(shot)[..., :3]
    assert picture.shape[1] == 1200
    # Ink on every fifth of the first screen, and white space too: laid out, not blank, not a blot.
    for part in np.array_split(picture, 5):
        assert 0.005 < np.mean(part < 0.9) < 0.6
    pages = len(re.findall(rb"/Type\s*/Page\b(?!s)", paper.read_bytes()))
    assert 5 <= pages <= 14


def test_the_delay_is_said_as_in_the_table_of_parameters() -> None:
    """Where intervals were widened: 247 to 290 µs stood below a table with 0 to 750."""
    analysis = fake_analysis("rigid")
    posterior = analysis.posterior
    middle = posterior.draws.mean(axis=0)
    wide = replace(posterior, chains=middle + 3 * (posterior.chains - middle))
    low, high = np.quantile(wide.draws[:, wide.names.index("delay_s")], (0.05, 0.95))
    said = delay(FakeAnalysis(**{**vars(analysis), "widened": wide}))
    assert interval(low, high, "s") in said and said != delay(analysis)


def test_what_is_narrow_beyond_reading_is_said_so() -> None:
    """A mass had "3.6e-05 %" of the prior's width."""
    rows = parameters(fake_analysis("free", None, spread=1e-7))
    assert "under 0.01 %" in {row.shrinkage for row in rows}
    assert not any("e" in row.shrinkage.replace("under", "") for row in rows)


def test_a_biased_response_is_not_said_to_be_what_was_fitted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Points 30 dB beside the model stood under a light that said "only noise is left"."""
    analysis = fake_analysis("free")
    assert "Feedback biases the points" not in response_caption(analysis)
    monkeypatch.setattr(Etfe, "direct", True)
    assert "Feedback biases the points" in response_caption(analysis)


def test_a_command_is_typeset_as_one() -> None:
    """One option of it was in another font than the rest."""
    command = "bayeshaptic report a.csv --quiet"
    page = template("report.jinja").environment.from_string(
        "{% import 'macros.jinja' as m %}{{ m.facts((('Command', command), ('Seed', '0'))) }}"
    )
    assert f"<dd><code>{command}</code></dd>" in page.render(command=command)


def test_what_the_measured_crossing_may_hide_stands_beside_it() -> None:
    analysis = fake_analysis("rigid")
    own = analysis.etfe_limit
    said = "near 8.9 Hz the phase is nearer to \N{MINUS SIGN}180 degrees than its noise"
    plain = [w.remark for w in witnesses(analysis) if w.key == "etfe"]
    analysis.etfe_limit = replace(own, caveat=said)
    (remark,) = [w.remark for w in witnesses(analysis) if w.key == "etfe"]
    assert remark == f"{plain[0]}; {said}"
    assert said in [row[-1] for row in comparison(analysis) if row[0] == "measurement alone"][0]
