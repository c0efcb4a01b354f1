"""Whatever is handed to a public function, a wrong type or number is one line that names it."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterator
from fractions import Fraction
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import bayeshaptic as bh
from bayeshaptic.stability.cases import DeviceLimit

CLASSES = {name: getattr(bh, name) for name in dir(bh) if inspect.isclass(getattr(bh, name))}
# Arguments for which anything may be given, or which the function itself looks at.
FREE = {("analyse", "options"), ("close_loop", "options")}


def blank(kind: type) -> Any:
    """An instance of a class, with nothing in it: a door looks at no more than the class."""
    return object.__new__(kind)


def good(annotation: str) -> Any:
    """Something that an annotation allows."""
    first = annotation.split(" | ")[0]
    plain = {"int": 5, "float": 0.5, "bool": True, "str": "x", "Path": Path("x"), "Columns": "x"}
    plain |= {"StudyAnalysis": SimpleNamespace(new_person=1)}
    plain |= {"Any": SimpleNamespace(model=1), "Result": SimpleNamespace(analysis=1)}
    if "None" in annotation or first in plain:
        return None if "None" in annotation else plain[first]
    if first.startswith("os.PathLike"):
        return "x"
    if first.startswith("Sequence[tuple"):
        return [({}, 0.5)]
    if match := re.match(r"(?:Sequence|Iterable|tuple)\[(\w+)", first):
        return [good(match[1])]
    if first in ("ArrayLike", "Floats", "Span"):
        return [0.5, 0.6]
    return blank(CLASSES[first])


def doors() -> Iterator[tuple[str, Callable[..., Any]]]:
    for name in dir(bh):
        value = getattr(bh, name)
        if inspect.isfunction(value):
            yield name, value


def cases() -> Iterator[Any]:
    for name, function in doors():
        for argument in inspect.signature(function).parameters.values():
            variable = argument.kind in (argument.VAR_POSITIONAL, argument.VAR_KEYWORD)
            if not variable and (name, argument.name) not in FREE:
                yield pytest.param(function, argument.name, id=f"{name}-{argument.name}")


@pytest.mark.parametrize(("function", "wrong"), list(cases()))
def test_an_argument_of_a_wrong_type(
    function: Callable[..., Any], wrong: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    parameters = inspect.signature(function).parameters.values()
    given = {
        one.name: good(str(one.annotation))
        for one in parameters
        if one.default is one.empty or one.name == wrong
    }
    given = {name: value for name, value in given.items() if name not in ("options", "changes")}
    with pytest.raises(bh.InputError) as caught:
        function(**given | {wrong: object()})
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 250
    assert wrong in str(caught.value)
    assert not list(tmp_path.iterdir())


FREE_MODEL = bh.free(device="lhifam")
REGION = bh.kb_region(FREE_MODEL)
LIMIT = bh.CriticalStiffness(np.ones(32), np.ones(32), "N/m", (), np.zeros(32, int))
OF_ALL = DeviceLimit(np.ones(32), np.zeros(32, int), (), "N/m")


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: bh.Options(prior={"m1": (0.1, 0.2)}), "prior['m1'] is (0.1, 0.2); give a Prior"),
        (lambda: bh.free(prior={"m1": (0.1, 0.2)}), "give a Prior (see bayeshaptic.LogNormal)"),
        (lambda: bh.Options(prior=[1]), "prior is"),
        (lambda: bh.Normal(np.nan, 1), "mean is nan; give a number"),
        (lambda: bh.Normal("0", 1), "mean is '0'; give a number"),
        (lambda: bh.LogNormal(np.inf, 1), "median is inf"),
        (lambda: bh.HalfNormal(None), "scale is None"),
        (lambda: bh.LowPass("30 Hz"), "cutoff_hz is '30 Hz'"),
        (lambda: bh.LowPass(-30), "cutoff_hz is -30; give a number above 0"),
        (lambda: LIMIT.safe(2), "risk is 2; give a number between 0 and 1"),
        (lambda: LIMIT.safe("1 %"), "risk is '1 %'"),
        (lambda: LIMIT.quantile([0.1, 1.1]), "p is"),
        (lambda: OF_ALL.quantile(1.1), "p is 1.1; give a number between 0 and 1"),
        (lambda: OF_ALL.probability_unstable("x"), "stiffness is 'x'; give numbers"),
        (lambda: LIMIT.tip(0), "lever_m is 0; give a number above 0"),
        (lambda: LIMIT.probability_unstable("x"), "stiffness is 'x'; give numbers"),
        (lambda: bh.Options(seed=-1), "seed is -1; give a number of at least 0"),
        (lambda: bh.Options(budget_s=0.0), "budget_s is 0.0; give a number above 0"),
        (lambda: bh.Options(seed=1.5), "seed is 1.5; give a whole number"),
        (lambda: bh.Options(band_hz=(200, 1)), "give the lower one first"),
        (lambda: bh.Options(band_hz=200), "band_hz is 200; give a sequence of 2 numbers"),
        (lambda: bh.Options(held="yes"), "held is 'yes'; give True or False"),
        (
            lambda: bh.Options(progress=3),
            "progress is 3; give a function of the share done and a word or True",
        ),
        (lambda: bh.Options(delay_s=-1e-4), "delay_s is -0.0001; give a number of at least 0"),
        (lambda: bh.Settings(rows=3), "rows is 3; give a sequence"),
        (lambda: bh.Settings(model=3), "model is 3; give a text"),
        (lambda: bh.read_recording(None), "path is None; give a text or a path"),
        (lambda: bh.read_recording("a.csv", rows=(1, "2")), "rows is"),
        (lambda: bh.recording_from_arrays("xy", [1, 2]), "force is 'xy'; give numbers"),
        (lambda: bh.estimate_etfe(3), "give a Recording (see bayeshaptic.read_recording) or"),
        (lambda: bh.sample(blank(bh.Model), None), "etfe is None; give an Etfe"),
        (lambda: bh.Normal(0.2, 0.1, low=5), "Normal needs low below mean + 6 sd"),
        (lambda: bh.Normal(0.2, 0.1, low=np.inf), "Normal needs low below mean + 6 sd"),
        (lambda: bh.free(prior={"m1": bh.Uniform(-2, -1)}), "prior of m1 is Uniform(low=-2, high"),
        (lambda: bh.free(prior={"m1": bh.Normal}), "prior['m1'] is of type"),
        (lambda: LIMIT.probability_unstable(np.nan), "stiffness is nan; give a number other than"),
        (lambda: bh.critical_stiffness(FREE_MODEL, [np.nan] * 6), "give numbers other than NaN"),
        (lambda: bh.critical_stiffness(FREE_MODEL, [0.0] * 6), "m1 is 0; a mass must be above 0"),
        (lambda: bh.critical_stiffness(FREE_MODEL, [1.0] * 5), "has 6 parameters"),
        (lambda: bh.critical_stiffness(bh.Settings()), "source is of type Settings; give a Model"),
        (lambda: bh.kb_region(SimpleNamespace(model=1)), "source is of type SimpleNamespace; give"),
        (lambda: REGION.probability([1, 2, 3], [1, 2]), "stiffness has the shape (3,) and damping"),
        (lambda: REGION.probability(np.nan, 0), "stiffness is nan; give a number other than NaN"),
        (lambda: REGION.quantile(0.05, [np.nan]), "damping is [nan]; give numbers other than NaN"),
        (lambda: FREE_MODEL.prior("zz"), "no parameter zz in the free model; it has m1, b1"),
        (lambda: FREE_MODEL.unit("zz"), "no parameter zz in the free model"),
        (
            lambda: bh.recording_from_arrays(np.array(["1"] * 9), np.ones(9), 1e-3),
            "force is of type ndarray of <U1; give numbers",
        ),
        (lambda: FREE_MODEL.response({"m1": 1}, [1.0]), "theta is of type dict; give numbers"),
        (lambda: FREE_MODEL.with_effect("reflex"), "effect is 'reflex'; give an effect"),
        (lambda: FREE_MODEL.response(FREE_MODEL.values, [np.nan]), "frequency_hz is [nan]; give"),
        (lambda: FREE_MODEL.response(FREE_MODEL.values, [[1.0]]), "frequency_hz has the shape (1,"),
        (lambda: FREE_MODEL.with_known({"m1": -1}), "m1 is -1; a mass of the motor side can be"),
        (lambda: bh.read_recording("\0"), "'\\x00' is no path"),
        (lambda: bh.read_study("\0"), "'\\x00' is no path"),
        (lambda: bh.elasticities(3), "source is 3; give a Model, Fit, Posterior"),
        (lambda: bh.write_report(3, "out"), "result is 3; give what bayeshaptic.analyse"),
        (lambda: bh.device_limit([3]), "cases is [3]; give a sequence of a Case"),
        (lambda: bh.device_limit(iter([3])), "cases is of type list_iterator; give a sequence"),
        (
            lambda: bh.Case("a", "hold", FREE_MODEL, np.ones((32, 6)), LIMIT),
            "group is 'hold'; give",
        ),
        (
            lambda: bh.Case("a", "held", FREE_MODEL, np.ones((32, 5)), LIMIT),
            "shape (32, 5); of this model they have 6 columns, m1, ",
        ),
        (
            lambda: bh.Case("a", "held", FREE_MODEL, np.ones((32, 6)), 3),
            "limit is 3; give a Critical",
        ),
        (lambda: bh.sweep(FREE_MODEL, "kc", []), "factors is empty; give one number or more"),
        (
            lambda: bh.sweep(FREE_MODEL, "kc", [np.nan]),
            "factors is [nan]; give numbers of at least 0",
        ),
        (lambda: bh.sweep(FREE_MODEL, "kc", [2.0], [1.0]), "factors and add are both given"),
        (lambda: bh.sweep(FREE_MODEL, "m1", [0.0]), "m1 is 0; a mass must be above 0"),
        (lambda: bh.critical_stiffness(FREE_MODEL, np.empty((0, 6))), "theta is empty; give one"),
        (lambda: bh.run_batch("a.csv", "out"), "sources is 'a.csv'; give a sequence of a text"),
    ],
)
def test_the_line_says_what_to_give(call: Callable[[], Any], words: str) -> None:
    with pytest.raises(bh.InputError, match=re.escape(words)) as caught:
        call()
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "call",
    [
        partial(bh.Normal, np.float64(1), np.float32(2)),
        partial(bh.Options, seed=np.int64(3), band_hz=[1, 200], delay_sd_s=float("inf")),
        partial(bh.Options, progress=True, prior=None, delay_s=Fraction(1, 5000)),
        partial(bh.Options, budget_s=1e-300, ess=np.float32(50)),
        partial(LIMIT.quantile, np.array([0.1, 0.9])),
        partial(LIMIT.probability_unstable, 3),
        partial(bh.recording_from_arrays, [1, 2] * 9, [3, 4] * 9, 1e-3),
    ],
)
def test_numbers_and_lists_of_like_types_are_taken(call: Callable[[], Any]) -> None:
    assert call() is not None


def test_short_floats_of_numpy_show_themselves() -> None:
    assert "1.00 ms" in repr(bh.rigid(period_s=np.float32(1e-3), delay_s=np.float32(1)))


def test_a_misspelt_argument_is_named_with_its_function() -> None:
    function: Any = bh.recording_from_arrays
    words = r"recording_from_arrays\(\) .*'perod_s' \(did you mean 'period_s'\?\)"
    with pytest.raises(TypeError, match=words):
        function([0.0], [0.0], perod_s=1e-3)
    with pytest.raises(TypeError, match=r"recording_from_arrays\(\) missing .*'position'$"):
        function([0.0])
