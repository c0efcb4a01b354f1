"""What the documents say: their snippets run, their links lead somewhere, their numbers hold."""

from __future__ import annotations

import ast
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

import bayeshaptic
from bayeshaptic.cli import build_parser, main
from bayeshaptic.diagnosis.base import high_passed
from bayeshaptic.diagnosis.base.alignment import LESS_DELAY, MOVED
from bayeshaptic.faq import entries, entry

ROOT = Path(__file__).parents[2]
PAGES = sorted(
    {
        *ROOT.glob("*.md"),
        *ROOT.glob("docs/**/*.md"),
        *ROOT.glob("data/*.md"),
        ROOT / "bayeshaptic" / "faq.md",
    }
)
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")


def blocks(page: Path, language: str) -> list[str]:
    text = page.read_text(encoding="utf-8")
    return [code for name, code in BLOCK.findall(text) if name == language]


def with_snippets() -> list[Path]:
    own = ROOT / "CONTRIBUTING.md"  # a test of its own
    return [page for page in PAGES if page != own and blocks(page, "python")]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_a_page_has_no_marks_of_a_merge(page):
    assert not re.search(r"^(<{7}|={7}|>{7})( |$)", page.read_text(encoding="utf-8"), re.MULTILINE)


@pytest.mark.parametrize("page", with_snippets(), ids=lambda page: str(page.relative_to(ROOT)))
def test_snippets_run(page: Path, tmp_path: Path) -> None:
    """All snippets of a page, one after the other in a process of their own, warnings as errors."""
    (tmp_path / "data").symlink_to(ROOT / "data")
    code = "\n".join(blocks(page, "python"))
    # A script with a guard, as where a snippet starts processes.
    script = tmp_path / "snippets.py"
    script.write_text(code, encoding="utf-8")
    command = [sys.executable, "-W", "error", "-W", "ignore::FutureWarning", str(script)]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr


USED = """
import bayeshaptic as bh
from bayeshaptic.diagnosis.loop import trace
from bayeshaptic.effects.laws import fitted
from bayeshaptic.effects.nonlinear.internal_force import MOTOR
from bayeshaptic.effects.nonlinear.shapes import Usual
from bayeshaptic.recordings import register_reader
from bayeshaptic.rig import Bench, WhiteNoise, simulate

bench = Bench.from_device("lhifam").with_effect("extra_delay")
low, high = bench.band_hz
made = simulate(bench, WhiteNoise(bench.force_rms, high, low, 8.0), seed=1)
time = bench.period_s * np.arange(len(made.force))
np.column_stack([time, made.force, 1e3 * made.position]).astype("<f4").tofile("x.raw")
register_reader(READER)
columns = "time=time_s,force=force_n[N],position=position_m[mm]"
recording = bh.read_recording("x.raw", columns=columns)
etfe = bh.estimate_etfe(recording)

found = trace(etfe, bh.least_squares(bh.free(device="lhifam"), etfe)).state.accepted[0]
assert "late_sensor" in (found.name, *found.ties)
assert "rounded_friction" in dict(fitted(MOTOR, Usual(1.0, 1.0, "m")))
values = dict.fromkeys(THREE.names, np.ones(1))
assert THREE.build(values).state_matrix().shape == (1, 6, 6)
"""


def test_what_contributing_adds_works(tmp_path: Path) -> None:
    """Its snippets, and then what they add is used: a reader, a model, an effect, a law."""
    code = "\n".join(blocks(ROOT / "CONTRIBUTING.md", "python")) + USED
    command = [sys.executable, "-W", "error", "-W", "ignore::FutureWarning", "-c", code]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr


def test_the_readme_has_two_commands_of_one_line() -> None:
    commands = [line for block in blocks(ROOT / "README.md", "sh") for line in block.splitlines()]
    assert len(commands) == 2
    report, tests = commands
    assert report.startswith("python3 -m venv .venv && ") and "bayeshaptic report" in report
    assert tests.startswith("python3 -m venv .venv && ") and "-m pytest" in tests
    arguments = report.split("bayeshaptic report ")[1].split()
    understood = build_parser().parse_args(["report", *arguments])
    assert (ROOT / understood.source).is_file()


def commands(page: Path) -> list[list[str]]:
    """The arguments of every `bayeshaptic` in the fenced blocks of a page."""
    inside, found = False, []
    for line in page.read_text(encoding="utf-8").splitlines():
        inside ^= line.startswith("```")
        if inside and line.startswith("bayeshaptic "):
            found.append(shlex.split(line.removeprefix("bayeshaptic ")))
    return found


@pytest.mark.parametrize(
    "page", [page for page in PAGES if commands(page)], ids=lambda page: str(page.relative_to(ROOT))
)
def test_commands_are_understood(page: Path) -> None:
    for arguments in commands(page):
        understood = build_parser().parse_args(arguments)
        assert callable(understood.run), arguments


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_to_files(page: Path) -> None:
    for target in LINK.findall(page.read_text(encoding="utf-8")):
        if not re.match(r"https?:|#", target):
            assert (page.parent / target.split("#")[0]).exists(), f"{page.name}: {target}"


def test_every_page_is_linked_from_the_readme_or_the_index() -> None:
    linked = {ROOT / "README.md", ROOT / "docs" / "README.md", ROOT / "docs" / "index.md"}
    for index in (ROOT / "README.md", ROOT / "docs" / "README.md"):
        for target in LINK.findall(index.read_text(encoding="utf-8")):
            linked.add((index.parent / target.split("#")[0]).resolve())
    assert not [page for page in PAGES if page.resolve() not in linked]


def test_every_folder_of_the_package_is_in_the_architecture() -> None:
    text = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    folders = {path.parent.name for path in (ROOT / "bayeshaptic").glob("*/*.py")}
    assert not [name for name in sorted(folders - {"bayeshaptic"}) if f"`{name}/`" not in text]
    for name in re.findall(r"`(\w+/[\w/]*(?:\.py)?)`", text):
        assert (ROOT / "bayeshaptic" / name).exists() or (ROOT / name).exists(), name


def test_every_key_of_the_summary_is_described() -> None:
    from fake_analysis import fake_analysis

    from bayeshaptic.report.summary import summary

    text = (ROOT / "docs" / "file-formats.md").read_text(encoding="utf-8")
    text = text.partition("## population.json")[0]
    for key, content in summary(fake_analysis()).items():
        assert f"| `{key}` |" in text
        (line,) = (line for line in text.splitlines() if line.startswith(f"| `{key}` |"))
        names = content if isinstance(content, dict) and key != "error" else {}
        missing = [name for name in names if f"`{name}`" not in line and not name.startswith("q")]
        assert not missing, f"{key}: {missing}"


def test_every_public_name_is_in_the_reference() -> None:
    text = (ROOT / "docs" / "reference" / "python.md").read_text(encoding="utf-8")
    listed = set(re.findall(r"^\.\. auto(?:class|function):: (\w+)$", text, re.MULTILINE))
    assert listed == set(bayeshaptic.__all__) - {"__version__", "plot"}
    assert "automodule:: bayeshaptic.plot" in text


def calls_of(name: str) -> dict[Path, list[ast.Call]]:
    """Every call of a function or class by its bare name, by file of the package."""
    found: dict[Path, list[ast.Call]] = {}
    for path in sorted((ROOT / "bayeshaptic").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and getattr(node.func, "id", None) == name:
                found.setdefault(path.relative_to(ROOT / "bayeshaptic"), []).append(node)
    return found


def test_every_warning_has_an_entry() -> None:
    topics = {
        call.args[1].value
        for name in ("Notice", "say")
        for calls in calls_of(name).values()
        for call in calls
        if len(call.args) > 2 and isinstance(call.args[1], ast.Constant)
    }
    topics |= {"a person not yet seen", "device limit"}  # "No {part}: why" of a study
    topics |= {LESS_DELAY, MOVED, high_passed.TOPIC}
    assert {"feedback", "units", "misfit", "not steady"} <= topics
    for topic in sorted(topics):
        assert topic in entry(topic).title.split(", ") and entry(topic).paragraphs


def test_every_refusal_has_an_entry() -> None:
    places = [place for one in entries().values() for place in one.places]
    assert all((ROOT / "bayeshaptic" / place).exists() for place in places)
    refusing = calls_of("InputError")
    assert not [path for path in refusing if not path.as_posix().startswith(tuple(places))]
    for calls in refusing.values():
        for keyword in (one for call in calls for one in call.keywords if one.arg == "topic"):
            assert isinstance(keyword.value, ast.Constant) and keyword.value.value in entries()


def test_a_message_leads_to_its_entry(capsys: pytest.CaptureFixture[str]) -> None:
    relay = ROOT / "data" / "recordings" / "phantom-user-relay.csv.gz"
    for command, word in (
        (["report", str(relay)], "relay"),
        (["report", "nothing.csv"], "file"),
        (["report", str(relay), "--columns", "force=nothing"], "columns"),
        (["status", str(ROOT)], "options"),
    ):
        assert main(command) == 2
        assert capsys.readouterr().err.rstrip().endswith(f" [bayeshaptic explain {word}]")
        assert main(["explain", word]) == 0
        assert capsys.readouterr().out.startswith(entry(word).title)
    with pytest.raises(bayeshaptic.InputError) as caught:
        bayeshaptic.read_recording("nothing.csv")
    assert caught.value.__notes__ == ["bayeshaptic explain file"]
    assert main(["explain"]) == 0
    listed = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in listed] == list(entries())


def test_the_gallery_is_light_and_needs_nothing() -> None:
    pages = sorted((ROOT / "docs" / "gallery").glob("*.html"))
    assert [page.stem for page in pages] == ["clean", "explained", "refused", "unexplained"]
    for page in pages:
        text = page.read_text(encoding="utf-8")
        assert len(text) < 2_000_000 and text.rstrip().endswith("</html>")
        assert 'src="http' not in text and "/tmp/" not in text
