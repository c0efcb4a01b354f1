"""The analysis of a study: every recording, its users and configurations, the device's limit."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

from bayeshaptic.arguments import at_the_door
from bayeshaptic.devices import Device
from bayeshaptic.diagnosis.analyse import analyse
from bayeshaptic.diagnosis.base.asked import device_of, has_a_hand
from bayeshaptic.diagnosis.close_loop import close_loop
from bayeshaptic.diagnosis.hidden.prior import HiddenPrior
from bayeshaptic.diagnosis.hidden.several import Together
from bayeshaptic.diagnosis.options import Options, options_from
from bayeshaptic.diagnosis.result import Result
from bayeshaptic.errors import InputError, Notice, describe
from bayeshaptic.inference.choose import CANDIDATES
from bayeshaptic.inference.population.population import Population
from bayeshaptic.models import prior_from_table
from bayeshaptic.models.prior_table import refuse_unknown
from bayeshaptic.quantities import quantity
from bayeshaptic.recordings.checks.sufficiency import refuse_where_told
from bayeshaptic.recordings.study import Study, StudyEntry
from bayeshaptic.shown import Shown, data_frame
from bayeshaptic.stability.cases import Case, DeviceLimit
from bayeshaptic.study.analysed import Analysed, names_of
from bayeshaptic.study.cases import StudyCases, study_cases
from bayeshaptic.study.configuration_limits import ConfigurationLimits
from bayeshaptic.study.hidden import known_together
from bayeshaptic.types import Executor, Progress

_RECORDINGS = 0.8  # share of the progress that the recordings take


@dataclass(frozen=True, eq=False, repr=False)
class StudyAnalysis(Shown):
    """Everything that is known of one device from one study.

    Attributes
    ----------
    study : Study
    device : Device
    recordings : tuple of Analysed
        In the order of the study.
    population : Population or None
        None where nobody holds the device.
    new_person : tuple of Case
        A person not yet seen; one case for each configuration that people were measured in, that
        of most people first: it stands for a new person's limit wherever there is one number.  A
        single one without configurations; empty without a population.
    users : tuple of Case
        K_CR of each user, shrunken towards the population.
    configurations : tuple of ConfigurationLimits
        Over a numeric coordinate, free and held; empty without one.
    cases : tuple of Case
        Everything that the device must stay stable in, the above included.
    limit : DeviceLimit or None
        Over all cases; None where every recording failed.
    notices : tuple of Notice
    seconds : mapping
        Stage to the time it took.
    hidden : tuple of Together
        What could hide in the device, by each recording and by all of them; empty where nobody
        asked, and where one recording alone knows of it.
    """

    study: Study
    device: Device
    recordings: tuple[Analysed, ...]
    population: Population | None
    new_person: tuple[Case, ...]
    users: tuple[Case, ...]
    configurations: tuple[ConfigurationLimits, ...]
    cases: tuple[Case, ...]
    limit: DeviceLimit | None
    notices: tuple[Notice, ...]
    seconds: Mapping[str, float]
    hidden: tuple[Together, ...] = ()

    @property
    def name(self) -> str:
        return self.study.name

    @property
    def failed(self) -> tuple[Analysed, ...]:
        """The recordings that could not be analysed."""
        return tuple(one for one in self.recordings if one.error is not None)

    def to_dataframe(self) -> Any:
        """A ``pandas.DataFrame``, a row a case: quantiles of its limit, and how often it binds."""
        shares = {b.case: b.probability for b in self.limit.binding} if self.limit else {}
        return data_frame(
            (
                {
                    "case": case.label,
                    "group": case.group,
                    **{
                        f"q{100 * p:02.0f}": float(case.limit.quantile(p))
                        for p in (0.05, 0.5, 0.95)
                    },
                    "unit": case.limit.unit,
                    "binds": shares.get(case.label, 0.0),
                }
                for case in self.cases
            ),
            "case",
        )

    def _lines(self) -> tuple[str, ...]:
        safe = None if self.limit is None else self.limit.safe(0.01)
        told = (
            "not stated" if safe is None or self.limit is None else quantity(safe, self.limit.unit)
        )
        return (
            f"Study {self.name} of {self.device.name}: {len(self.recordings)} recordings, "
            f"{len(self.failed)} failed",
            f"{len(self.users)} users, {len(self.configurations)} sets of configurations, "
            f"{len(self.cases)} cases",
            f"stable in every case with 99 %: {told}",
        )


@dataclass(frozen=True)
class Task:
    """One recording to analyse: picklable, so that another process can do it."""

    number: int
    study: Study
    entry: StudyEntry
    model: str
    close_loop: bool
    options: Options


@dataclass(frozen=True)
class _Outcome:
    """How one task ended, as the executors say it."""

    item: Task
    result: Any = None
    error: str | None = None


@at_the_door
def analyse_study(
    study: Study,
    model: str = "auto",
    close_loop: bool = False,
    options: Options | None = None,
    executor: Executor | None = None,
    **changes: Any,
) -> StudyAnalysis:
    """Analyse every recording of a study, then what they say together.

    Parameters
    ----------
    study : Study
        See `bayeshaptic.read_study`.
    model : {"auto", "rigid", "free", "grasped"}
        Where "auto", a recording with a user is grasped and one without is rigid or free.
    close_loop : bool
        Whether to look for what the model lacks in every recording.
    options : Options, optional
        A device here takes the place of the study's own.
    executor : callable, optional
        Where the recordings are analysed (see `bayeshaptic.jobs.executors`); by default here,
        one after the other.
    **changes
        Single options by name, as in `bayeshaptic.analyse`.

    Returns
    -------
    StudyAnalysis
        A recording that fails is in it with its error and does not stop the others.

    Raises
    ------
    InputError
        Where a prior of the study cannot be understood, or is of no parameter, or no effect.
    """
    study = study.with_periods_apart()
    with _in_the_file(study):
        prior = {name: prior_from_table(name, table) for name, table in study.prior.items()}
        if model == "auto" and options_from(options, changes).modes is None:
            refuse_unknown(prior, CANDIDATES)
        HiddenPrior.from_table(study.effects)
    chosen = options_from(options, changes)
    device = device_of(chosen, model) or study.device
    effects = {**study.effects, **chosen.effects}
    HiddenPrior.from_table(effects)
    chosen = replace(chosen, device=device, prior=prior | dict(chosen.prior), effects=effects)
    tasks = [
        Task(number, study, entry, model, close_loop, replace(chosen, progress=None))
        for number, entry in enumerate(study.entries)
    ]
    report = chosen.report
    began = time.perf_counter()
    recordings = _analysed(tasks, report, executor)
    seconds = {"recordings": time.perf_counter() - began}
    known = known_together(recordings, chosen.seed)
    recordings = known.recordings
    whole = study_cases(
        recordings,
        chosen.seed,
        lambda share, word: report(_RECORDINGS + (1 - _RECORDINGS) * share, word),
    )
    report(1.0, "done")
    return StudyAnalysis(
        study,
        device,
        recordings,
        notices=study.notices + _failures(recordings) + known.notices + whole.notices,
        seconds=seconds | dict(whole.seconds),
        hidden=known.effects,
        **_parts(whole),
    )


def analyse_entry(task: Task, progress: Progress | None = None) -> Result:
    """Read and analyse one recording of a study."""
    held: bool | None = task.entry.user is not None
    modes = None if held else task.options.modes  # of the device by itself
    if modes is None and task.model != "auto" and held != has_a_hand(task.model):
        held = None  # who asks for one model of all means it
    options = replace(task.options, held=held, modes=modes, progress=progress)
    run = close_loop if task.close_loop else analyse
    result = run(task.study.read(task.entry), task.model, options)
    # The limits of a study leave out what has none.
    refuse_where_told(result.analysis.recording, result.analysis.notices)
    return result


def _analysed(
    tasks: Sequence[Task], report: Progress, executor: Executor | None
) -> tuple[Analysed, ...]:
    """All recordings in their order; the progress counts those that are done."""
    names = names_of([task.entry for task in tasks])
    done: dict[int, Analysed] = {}
    outcomes = (
        _one_by_one(tasks, names, report) if executor is None else executor(analyse_entry, tasks)
    )
    for outcome in outcomes:
        number = outcome.item.number
        done[number] = Analysed(names[number], tasks[number].entry, outcome.result, outcome.error)
        report(_RECORDINGS * len(done) / len(tasks), f"{names[number]} is done")
    return tuple(done[task.number] for task in tasks)


def _one_by_one(
    tasks: Sequence[Task], names: Sequence[str], report: Progress
) -> Iterator[_Outcome]:
    for task, name in zip(tasks, names, strict=True):

        def part(share: float, word: str, task: Task = task, name: str = name) -> None:
            report(_RECORDINGS * (task.number + share) / len(tasks), f"{name}: {word}")

        try:
            yield _Outcome(task, analyse_entry(task, part))
        except Exception as error:
            yield _Outcome(task, error=describe(error))


@contextmanager
def _in_the_file(study: Study) -> Iterator[None]:
    """What cannot be understood stands in the study's file."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{study.path}: {error}", topic="study") from None


def _parts(whole: StudyCases) -> dict[str, Any]:
    names = ("population", "new_person", "users", "configurations", "cases", "limit")
    return {name: getattr(whole, name) for name in names}


def _failures(recordings: Sequence[Analysed]) -> tuple[Notice, ...]:
    failed = [one for one in recordings if one.error is not None]
    if not failed:
        return ()
    text = f"{len(failed)} of {len(recordings)} recordings could not be used: " + "; ".join(
        f"{one.name} ({one.error})" for one in failed
    )
    return (Notice("warning", "recordings", text),)
