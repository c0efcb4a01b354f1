"""Every argument of the public interface is documented, with the name it has."""

from __future__ import annotations

import ast
import dataclasses
import inspect
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import bayeshaptic

PACKAGE = Path(bayeshaptic.__file__).parent
FIELD = re.compile(r"^(\*{0,2}\w+(?:, *\*{0,2}\w+)*)(?: *:.*)?$")


def documented(docstring: str | None, section: str) -> list[str]:
    """The names that a NumPy-style section of a docstring describes, in order."""
    lines = inspect.cleandoc(docstring or "").splitlines()
    names: list[str] = []
    for start, line in enumerate(lines[:-1]):
        if line == section and set(lines[start + 1]) == {"-"}:
            for field, following in zip(lines[start + 2 :], [*lines[start + 3 :], ""], strict=True):
                if following and set(following) == {"-"}:
                    break
                match = FIELD.match(field)
                if match and not field.startswith(" "):
                    names += [name.strip().lstrip("*") for name in match[1].split(",")]
    return names


def arguments(function: Callable[..., Any]) -> list[str]:
    return [name for name in inspect.signature(function).parameters if name not in ("self", "cls")]


def public_callables() -> Iterator[tuple[str, Callable[..., Any]]]:
    """Functions of the public interface, and public methods of its classes."""
    for name in bayeshaptic.__all__:
        value = getattr(bayeshaptic, name)
        if inspect.isfunction(value):
            yield name, value
        elif inspect.isclass(value):
            for method, function in inspect.getmembers(value, callable):
                own = method in vars(value)
                if own and not method.startswith("_") and not inspect.isclass(function):
                    yield f"{name}.{method}", function


def public_classes() -> Iterator[tuple[str, type]]:
    for name in bayeshaptic.__all__:
        value = getattr(bayeshaptic, name)
        if inspect.isclass(value):
            yield name, value


@pytest.mark.parametrize(
    ("name", "function"), [pytest.param(*c, id=c[0]) for c in public_callables()]
)
def test_arguments_are_documented(name: str, function: Callable[..., Any]) -> None:
    assert function.__doc__, f"{name} has no docstring"
    method = "." in name
    mentioned = documented(function.__doc__, "Parameters")
    if method and not mentioned:  # a short method may name its arguments in its sentence
        mentioned = re.findall(r"`+(\w+)`+", function.__doc__)
    missing = [argument for argument in arguments(function) if argument not in mentioned]
    assert not missing, f"{name}: undocumented arguments {missing}"


@pytest.mark.parametrize(("name", "value"), [pytest.param(*c, id=c[0]) for c in public_classes()])
def test_attributes_are_documented(name: str, value: type) -> None:
    assert value.__doc__ and not value.__doc__.startswith(f"{name}("), f"{name} has no docstring"
    if dataclasses.is_dataclass(value):
        mentioned = documented(value.__doc__, "Attributes")
        mentioned += documented(value.__doc__, "Parameters")
        fields = [field.name for field in dataclasses.fields(value) if field.name[0] != "_"]
        missing = [field for field in fields if field not in mentioned]
        assert not missing, f"{name}: undocumented attributes {missing}"


def sources() -> list[Path]:
    return sorted(PACKAGE.rglob("*.py"))


@pytest.mark.parametrize("path", sources(), ids=lambda path: str(path.relative_to(PACKAGE)))
def test_parameter_sections_match_their_signatures(path: Path) -> None:
    """Inside the package too: a Parameters section names every argument, and nothing else."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef):
            mentioned = documented(ast.get_docstring(node), "Parameters")
            every = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
            every += [extra for extra in (node.args.vararg, node.args.kwarg) if extra]
            names = [argument.arg for argument in every if argument.arg not in ("self", "cls")]
            assert not mentioned or sorted(mentioned) == sorted(names), f"{path.name}: {node.name}"


@pytest.mark.parametrize("path", sources(), ids=lambda path: str(path.relative_to(PACKAGE)))
def test_every_module_says_what_it_is_for(path: Path) -> None:
    assert ast.get_docstring(ast.parse(path.read_text(encoding="utf-8")))


def test_the_check_sees_an_undocumented_argument() -> None:
    def function(first: int, second: int) -> None:
        """Do it.

        Parameters
        ----------
        first : int
            The first,
            over two lines: with a colon.

        Returns
        -------
        nothing : None
        """

    assert documented(function.__doc__, "Parameters") == ["first"]
    assert arguments(function) == ["first", "second"]
