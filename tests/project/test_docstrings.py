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


def mentioned(docstring: str) -> set[str]:
    """Names in Parameters and Attributes sections, or for a short docstring every word of it."""
    listed = documented(docstring, "Parameters") + documented(docstring, "Attributes")
    for reference in re.findall(r"For the \w+ see `(\w+)`", docstring):  # ... see `grasped`.
        listed += documented(getattr(bayeshaptic, reference).__doc__, "Parameters")
    return set(listed) or set(re.findall(r"\w+", docstring))


@pytest.mark.parametrize(
    ("name", "function"), [pytest.param(*c, id=c[0]) for c in public_callables()]
)
def test_arguments_are_documented(name: str, function: Callable[..., Any]) -> None:
    owner, _, method = name.partition(".")
    docstring = inspect.getdoc(getattr(getattr(bayeshaptic, owner), method) if method else function)
    assert docstring, f"{name} has no docstring"
    missing = [argument for argument in arguments(function) if argument not in mentioned(docstring)]
    assert not missing, f"{name}: undocumented arguments {missing}"


@pytest.mark.parametrize(("name", "value"), [pytest.param(*c, id=c[0]) for c in public_classes()])
def test_attributes_are_documented(name: str, value: type) -> None:
    assert value.__doc__ and not value.__doc__.startswith(f"{name}("), f"{name} has no docstring"
    if dataclasses.is_dataclass(value):
        fields = [field.name for field in dataclasses.fields(value) if field.name[0] != "_"]
        said = {name for kind in value.__mro__[:-1] for name in mentioned(kind.__doc__ or "")}
        missing = [field for field in fields if field not in said]
        assert not missing, f"{name}: undocumented attributes {missing}"


def test_parameter_sections_name_no_argument_that_is_gone() -> None:
    for path in sorted(PACKAGE.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef):
                every = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
                every += [extra for extra in (node.args.vararg, node.args.kwarg) if extra]
                gone = set(documented(ast.get_docstring(node), "Parameters"))
                gone -= {argument.arg for argument in every}
                assert not gone, f"{path.name}: {node.name} has no {sorted(gone)}"


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
