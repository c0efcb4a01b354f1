"""Imports run one way, down the layers; and nothing heavy is imported before it is needed."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "bayeshaptic"

# From the bottom up. A module may import its own folder and what stands in a lower row; folders of
# one row do not import each other unless SIDEWAYS says so.
LAYERS = (
    ("compiled", "errors", "threads", "types"),
    ("numerics",),
    ("devices",),
    ("recordings",),
    ("models",),
    ("effects",),
    ("inference", "stability"),
    ("diagnosis",),
    ("study",),
    ("report",),
    ("jobs", "cli", "commands", "__main__"),
)
LEVEL = {name: level for level, names in enumerate(LAYERS) for name in names}
TOP = LAYERS[-1]
# The rig is the independent check on the models: beside them, not above.
RIG_MAY_IMPORT = {"rig", "compiled", "devices", "errors", "threads", "types"}
MAY_IMPORT_RIG = {"rig", *TOP}


def modules() -> list[Path]:
    return sorted(path for path in PACKAGE.rglob("*.py") if path != PACKAGE / "__init__.py")


def room(path: Path) -> str:
    """The folder (or the module at the top) that a file belongs to."""
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imported_rooms(source: str) -> set[str]:
    """Every folder of the package that a source imports, wherever in the file."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(source)):
        names: list[str] = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "relative import: write the whole name"
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        found |= {name.split(".")[1] for name in names if name.startswith("bayeshaptic.")}
    return found - {"__version__"}


def may_import(importer: str, imported: str) -> bool:
    if importer == "rig":
        return imported in RIG_MAY_IMPORT
    if imported == "rig":
        return importer in MAY_IMPORT_RIG
    if importer == imported or (importer in TOP and imported in TOP):
        return True
    return LEVEL[imported] < LEVEL[importer]


def test_every_folder_has_a_layer() -> None:
    assert {room(path) for path in modules()} - {"rig"} <= set(LEVEL)


@pytest.mark.parametrize("path", modules(), ids=lambda path: str(path.relative_to(PACKAGE)))
def test_imports_run_down_the_layers(path: Path) -> None:
    importer = room(path)
    wrong = {
        name
        for name in imported_rooms(path.read_text(encoding="utf-8"))
        if not may_import(importer, name)
    }
    assert not wrong, f"{importer}/ must not import {sorted(wrong)}"


def test_the_check_sees_an_import_inside_a_function() -> None:
    source = "def f():\n    from bayeshaptic.models.build import rigid\n"
    assert imported_rooms(source) == {"models"}
    assert not may_import("rig", "models")
    assert not may_import("recordings", "models")
    assert may_import("stability", "models")


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
