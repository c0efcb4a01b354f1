"""Nothing heavy is imported before it is needed; files and folders stay small."""

from __future__ import annotations

import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[2] / "bayeshaptic"


def modules_after(code: str) -> set[str]:
    """The top-level modules that a fresh interpreter has loaded after running `code`."""
    tail = "\nimport sys; print('MODULES', *{name.split('.')[0] for name in sys.modules})"
    done = subprocess.run(
        [sys.executable, "-c", code + tail], capture_output=True, text=True, check=True, timeout=60
    )
    line = next(line for line in done.stdout.splitlines() if line.startswith("MODULES"))
    return set(line.split()[1:])


HELP = """
from bayeshaptic.cli import main
try:
    main({arguments!r})
except SystemExit as stop:
    assert stop.code == 0
"""


@pytest.mark.parametrize(
    "code",
    [
        "import bayeshaptic",
        HELP.format(arguments=["--help"]),
        HELP.format(arguments=["report", "--help"]),
        HELP.format(arguments=["simulate", "--help"]),
        HELP.format(arguments=["batch", "--help"]),
    ],
    ids=["import", "--help", "report --help", "simulate --help", "batch --help"],
)
def test_help_and_import_load_nothing_heavy(code: str) -> None:
    heavy = {
        "numpy",
        "scipy",
        "matplotlib",
        "arviz",
        "emcee",
        "h5py",
        "jinja2",
        "numba",
        "tqdm",
        "xarray",
    }
    assert not heavy & modules_after(code)


@pytest.mark.parametrize("name", ["models", "inference", "stability", "recordings", "effects"])
def test_parts_load_without_plotting_and_sampling_libraries(name: str) -> None:
    if not (PACKAGE / name / "__init__.py").exists():
        pytest.skip(f"there is no bayeshaptic/{name}/")
    late = {"matplotlib", "arviz", "emcee", "h5py", "jinja2", "xarray"}
    code = f"""
import importlib, pkgutil, bayeshaptic.{name} as part
for module in pkgutil.walk_packages(part.__path__, part.__name__ + "."):
    importlib.import_module(module.name)
"""
    assert not late & modules_after(code)


def test_files_and_folders_stay_small() -> None:
    """House rule: some 300 lines a file, and fifteen modules a folder; of benchmarks, too."""
    files = [*PACKAGE.rglob("*.py"), *PACKAGE.with_name("benchmarks").rglob("*.py")]
    lines = {path: len(path.read_text(encoding="utf-8").splitlines()) for path in files}
    assert {str(path): count for path, count in lines.items() if count > 310} == {}
    folders = Counter(path.parent for path in lines if path.name != "__init__.py")
    assert {str(folder): count for folder, count in folders.items() if count > 15} == {}
