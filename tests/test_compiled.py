"""Compiled kernels: where nothing can be kept on disk, and who is told of a compilation."""

from __future__ import annotations

from bayeshaptic.compiled import kernel, when_compiling


def function_without_a_file():
    space: dict = {}
    exec("def half(x):\n    return x / 2", space)
    return space["half"]


def test_a_kernel_that_cannot_be_kept_on_disk_is_compiled_in_the_process() -> None:
    assert kernel(function_without_a_file())(3.0) == 1.5


def test_a_compilation_is_told_once() -> None:
    told = []
    when_compiling(lambda: told.append(1))
    try:
        half = kernel(function_without_a_file())
        half(3.0)
        half(5.0)
    finally:
        when_compiling(None)
    assert told == [1]
