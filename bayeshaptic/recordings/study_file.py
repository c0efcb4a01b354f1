"""A study's TOML file: what it may say, and how it is read."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from bayeshaptic.arguments import at_the_door
from bayeshaptic.devices import Device, device_from_table, device_names, load_device
from bayeshaptic.devices.table import Table, read_toml
from bayeshaptic.errors import InputError, Notice, nearest, refuse_no_path
from bayeshaptic.files import resolved
from bayeshaptic.recordings.columns import parse_columns
from bayeshaptic.recordings.cut import Cut, Span
from bayeshaptic.recordings.feedback import read_feedback
from bayeshaptic.recordings.known_limits import read_references
from bayeshaptic.recordings.read import Columns
from bayeshaptic.recordings.readers.packed import same_content
from bayeshaptic.recordings.study import Study, StudyEntry

STUDY_KEYS = ("device", "pool", "prior", "effects", "feedback", "recording", "reference")
ENTRY_KEYS = ("file", "user", "configuration", "trial", "level", "columns", "rows", "seconds")
# Of the priors in `bayeshaptic.models.prior_table`.
PRIOR_KEYS = (
    *("median", "log_sd", "scale", "floor", "rise", "seen", "weight"),
    *("mean", "sd", "low", "high", "log"),
)


@at_the_door
def read_study(path: str | os.PathLike[str], allow_outside: bool = False) -> Study:
    """A study from its TOML file.

    The file has a ``[device]`` table: a `name` of a known device, or the `file` of a device file,
    or the facts themselves (`kind` is then needed); what is written beside a name or a file
    overrides it; and `columns`. An optional ``[prior]`` table has a line a parameter: ``m1 = {
    median = 0.2, log_sd = 0.3 }``, ``b1 = { scale = 5 }`` (half-normal; with `floor` near zero),
    ``kc = { mean = 6e4, sd = 1e3 }``, ``m2 = { low = 1, high = 9 }`` (uniform; with ``log = true``
    in the logarithm). An optional ``[effects]`` table has prior probabilities of effects that are
    too small to be seen, ``extra_delay = 0.2``; `each` is that of all others. Each
    ``[[recording]]`` table has a `file`, relative to the study, and where they apply `user`,
    `configuration` (a number or a name), `trial`, `level`, `rows` or `seconds` (the part to read)
    and `columns` of its own. Recordings are looked for but not read; `Study.read` does that.
    Recordings that nothing tells apart count together as one; ``pool = true`` at the top joins
    trials and levels, too, and ``pool = false`` nothing. Optional ``[[reference]]`` tables hold
    limits known from elsewhere: `label`, `held`, and `critical_stiffness` or
    `critical_stiffness_db`. An optional ``[feedback]`` table says which controller was in the loop.

    Parameters
    ----------
    path : str or path
    allow_outside : bool
        Whether files outside the study's folder may be read; a study from somebody else should not
        choose which of one's files are opened.

    Returns
    -------
    Study

    Raises
    ------
    InputError
        For a missing file or one outside the folder, samples that are listed twice (in a copy of
        a file, too), unknown keys (with the nearest known one), wrong types and impossible values.
    """
    path = Path(path)
    table = Table(read_toml(path), str(path), known=STUDY_KEYS)
    if "device" not in table.content:
        raise InputError(
            f"{path}: no [device] table; it needs at least a name, or a kind and a name"
        )
    home = None if allow_outside else resolved(path.parent)
    device, columns, notices = _device(table.content["device"], path, home)
    entries = table.content.get("recording")
    if not isinstance(entries, list) or not entries:
        raise InputError(
            f"{path}: no recordings; add a [[recording]] table with file = '...' for each"
        )
    read = [
        _entry(entry, f"{path}, recording {number}", path.parent, home)
        for number, entry in enumerate(entries, start=1)
    ]
    _refuse_twice(read, columns, path)
    return Study(
        name=path.stem,
        path=path,
        device=device,
        entries=_pooled(read, _pool(table)),
        columns=columns,
        prior=_prior(table.content.get("prior", {}), f"{path}, [prior]"),
        effects=_effects(table.content.get("effects", {}), f"{path}, [effects]"),
        notices=notices,
        references=read_references(table.content.get("reference", []), path),
        feedback=read_feedback(table.content.get("feedback"), f"{path}, [feedback]"),
    )


def _pool(table: Table) -> bool | None:
    value = table.content.get("pool")
    if value is not None and not isinstance(value, bool):
        raise table.wrong("pool", "true or false")
    return value


def _refuse_twice(entries: Sequence[StudyEntry], columns: Columns, path: Path) -> None:
    """Refuse samples that are listed twice: they would count as twice the data.

    A copy of a file under another name, gzipped or not, is that file.
    """
    known: dict[Path, list[tuple[int, StudyEntry]]] = {}
    for number, entry in enumerate(entries, start=1):
        file = resolved(entry.path)
        of_one = next((one for one in known if one == file or same_content(one, file)), file)
        others = known.setdefault(of_one, [])
        for other, earlier in others:
            alike = parse_columns(entry.columns or columns) == parse_columns(
                earlier.columns or columns
            )
            if alike and _overlap(entry, earlier):
                is_one = (
                    f"is recording {other} already"
                    if file == resolved(earlier.path)
                    else f"is a copy of {earlier.path.name}, recording {other}"
                )
                raise InputError(
                    f"{path}, recording {number}: {entry.path.name} {is_one}, "
                    "and would count as twice the data; leave one out, or give each rows or "
                    "seconds of its own"
                )
        others.append((number, entry))


def _overlap(one: StudyEntry, other: StudyEntry) -> bool:
    """Whether two entries of the same columns of one file have samples in common."""
    if (one.rows and other.seconds) or (one.seconds and other.rows):  # only the file could tell
        return False
    spans = [entry.rows or entry.seconds for entry in (one, other)]
    lows, highs = zip(*(span or (0.0, math.inf) for span in spans), strict=True)
    return max(low or 0.0 for low in lows) < min(high or math.inf for high in highs)


def _pooled(entries: Sequence[StudyEntry], pool: bool | None) -> tuple[StudyEntry, ...]:
    """Those of the same user and configuration as one.

    Where the study does not say whether to, only those that nothing tells apart, neither a trial
    nor a level.
    """
    if pool is False:
        return tuple(entries)
    alike: dict[tuple[object, ...], list[StudyEntry]] = {}
    for entry in entries:
        said = () if pool else (entry.trial, entry.level)
        alike.setdefault((entry.user, entry.configuration, *said), []).append(entry)
    return tuple(replace(first, more=tuple(more)) for first, *more in alike.values())


def _file(folder: Path, file: str, home: Path | None, where: str) -> Path:
    """A file by what the study calls it; refused where it is not inside `home`."""
    path = folder / file
    refuse_no_path(path)
    if home is not None and not resolved(path).is_relative_to(home):
        raise InputError(
            f"{where}: {file} is outside the study's folder; copy it there, or allow it with "
            "--allow-outside"
        )
    if not path.is_file():
        raise InputError(f"{where}: no such file: {path}")
    return path


def _device(
    content: object, path: Path, home: Path | None
) -> tuple[Device, Columns, tuple[Notice, ...]]:
    where = f"{path}, [device]"
    table = Table(content, where)
    file, name, names = table.text("file"), table.text("name"), device_names()
    base: Device | None = None
    notices: tuple[Notice, ...] = ()
    if file is not None:
        base = load_device(_file(path.parent, file, home, where))
    elif name is not None and name.lower() in names:
        base = load_device(name)
    elif name is not None and "kind" not in table.content:
        raise InputError(
            f"{where}: no device '{name}' is known{nearest(name, names)}: there are "
            f"{', '.join(names)}; a device of your own needs kind = 'translational' or kind = "
            "'rotational'"
        )
    elif name is not None and nearest(name, names):
        text = f"No device '{name}' is known{nearest(name, names)}; only the study's facts hold."
        notices = (Notice("note", "device", text),)
    device = device_from_table(table.content, where, base, path.stem, ("file", "columns"))
    return device, _columns(table.content.get("columns"), where), notices


def _columns(columns: object, where: str) -> Columns:
    """The mapping, refused here and not at the first recording where it cannot be understood."""
    if columns is None:
        return None
    try:
        parse_columns(columns)  # type: ignore[arg-type]
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
    return columns  # type: ignore[return-value]


def _entry(content: object, where: str, folder: Path, home: Path | None) -> StudyEntry:
    table = Table(content, where, known=ENTRY_KEYS)
    file = table.text("file")
    if file is None:
        raise InputError(f"{where} needs a file: file = 'recording.csv'")
    rows, seconds = _span(table, "rows"), _span(table, "seconds")
    try:
        Cut(rows, seconds)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
    return StudyEntry(
        path=_file(folder, file, home, where),
        user=_label(table, "user"),
        configuration=_coordinate(table, "configuration"),
        trial=_trial(table),
        level=table.number("level"),
        columns=_columns(table.content.get("columns"), where),
        rows=rows,
        seconds=seconds,
    )


def _span(table: Table, key: str) -> Span | None:
    value = table.content.get(key)
    if value is None:
        return None
    if not isinstance(value, list) or len(value) != 2:
        raise table.wrong(key, "two numbers, [from, to]")
    ends = Table({"from": value[0], "to": value[1]}, f"{table.where}, {key}")
    low, high = ends.number("from", 0), ends.number("to", 0, above=True)
    if low is None or high is None or high <= low:
        raise table.wrong(key, "two numbers, [from, to] with from < to")
    return low, high


def _label(table: Table, key: str) -> str | None:
    """A name; a whole number will do for one."""
    value = table.content.get(key)
    if isinstance(value, int) and not isinstance(value, bool):
        return str(value)
    return table.text(key)


def _coordinate(table: Table, key: str) -> float | str | None:
    return table.text(key) if isinstance(table.content.get(key), str) else table.number(key)


def _trial(table: Table) -> int | str | None:
    value = table.content.get("trial")
    if value is None or (isinstance(value, int) and not isinstance(value, bool)):
        return value
    return table.text("trial")


def _effects(content: object, where: str) -> dict[str, float]:
    """Probabilities by name; which names there are is the library's business."""
    table, found = Table(content, where), {}
    for name in table.content:
        probability = table.number(name, 0)
        if probability is None or probability >= 1:
            raise table.wrong(name, "a probability, from 0 to below 1")
        found[name] = probability
    return found


def _prior(content: object, where: str) -> dict[str, dict[str, float | bool]]:
    """Priors as plain tables of numbers; what they mean is the models' business."""
    priors: dict[str, dict[str, float | bool]] = {}
    for parameter, prior in Table(content, where).content.items():
        table = Table(prior, f"{where}, {parameter}", known=PRIOR_KEYS)
        log = table.content.get("log", False)
        if not isinstance(log, bool):
            raise table.wrong("log", "true or false")
        numbers = {key: table.number(key) for key in table.content if key != "log"}
        priors[parameter] = {key: value for key, value in numbers.items() if value is not None}
        if log:
            priors[parameter]["log"] = True
    return priors
