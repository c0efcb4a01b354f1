"""A recording from arrays in memory: their lengths, values, times and units are checked here."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bayeshaptic.arguments import at_the_door
from bayeshaptic.errors import InputError, Notice, such
from bayeshaptic.recordings.readers.numbers import as_numbers
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.signals.continued import Rows, Signals, continued
from bayeshaptic.recordings.signals.raw_signals import increment_unit
from bayeshaptic.recordings.signals.rows.pauses import Run, runs_on_a_clock
from bayeshaptic.recordings.signals.rows.repeated import rows_read_once
from bayeshaptic.recordings.signals.rows.runs import (
    force_held,
    force_held_unevenly,
    held_for,
    held_unevenly,
    left_out,
    longest,
    moving_part,
    new_rows,
    position_held,
    rows_alike,
    written_each,
)
from bayeshaptic.recordings.signals.rows.uneven_rows import uneven_rows
from bayeshaptic.recordings.units import assumed_units, base_unit, choose_units
from bayeshaptic.types import Floats


@at_the_door
def recording_from_arrays(
    force: ArrayLike,
    position: ArrayLike,
    period_s: float | None = None,
    time: ArrayLike | None = None,
    force_unit: str | None = None,
    position_unit: str | None = None,
    kind: str | None = None,
    name: str = "recording",
    encoder_resolution: float | None = None,
    source: Path | None = None,
    reference: ArrayLike | None = None,
) -> Recording:
    """A recording from arrays in memory.

    Parameters
    ----------
    force, position : array_like, shape (N,)
        Commanded force and measured position; (N, 1) and (1, N) will do.
    period_s : float or None
        Sampling period in seconds. Beside time stamps it is the loop's: where these show a part of
        it, and the force is held in between, one row for each force is read. Or:
    time : array_like, shape (N,), or None
        Time stamps in seconds.
    force_unit : str or None
        "N", "Nm" or "A", or any that ``--columns`` takes, such as "mN m".
    position_unit : str or None
        "m" or "rad", or any that ``--columns`` takes, such as "mm" or "deg".
    kind : {"translational", "rotational"} or None
        Decides where the units are None; otherwise N and m.
    name : str
    encoder_resolution : float or None
        One encoder count, in `position_unit`.
    source : Path or None
        The file, for messages and reports.
    reference : array_like, shape (N,), or None
        What a controller followed, in any unit; used where the recording was made in closed loop.

    Returns
    -------
    Recording

    Raises
    ------
    InputError
        For arrays that differ in length, are empty or hold NaN or infinity (with the row, counted
        from 1), and for time stamps that show no even sampling.
    """
    where = str(source) if source is not None else name
    signals, stamps = _as_given(force, position, reference, time, where)
    if not (encoder_resolution is None or 0 < encoder_resolution < np.inf):
        raise InputError(f"{where}: encoder_resolution must be above 0, not {encoder_resolution}")
    if time is None and period_s is None and source is None:
        raise InputError(f"{where}: no time and no period; give period_s in seconds, or time")
    force, force_unit, _ = _in_base_unit(signals.force, "force", force_unit, where)
    position, position_unit, factor = _in_base_unit(
        signals.position, "position", position_unit, where
    )
    count = None if encoder_resolution is None else factor * encoder_resolution
    signals = replace(signals, force=force, position=position)
    signals, runs, said, held = _on_a_clock(signals, stamps, period_s, where)
    units = choose_units(force_unit, position_unit, kind, where)
    rows = continued(signals, runs, units[1] == "rad", count, where)
    rows = replace(rows, notices=(*said, *rows.notices))
    rows = _a_row_a_period(_without_standstill(rows), held, stamps is not None, period_s)
    return Recording(
        **vars(rows.signals),
        period_s=rows.period_s,
        force_unit=units[0],
        position_unit=units[1],
        name=name,
        encoder_resolution=count,
        time_jitter=_jitter(runs),
        source=source,
        notices=rows.notices + assumed_units(force_unit, position_unit, *units),
        joints=rows.joints,
    )


def _as_given(
    force: ArrayLike,
    position: ArrayLike,
    reference: ArrayLike | None,
    time: ArrayLike | None,
    where: str,
) -> tuple[Signals, Floats | None]:
    """The signals and their time stamps as arrays of numbers, all of one length."""
    signals = Signals(
        _signal(force, "force", where),
        _signal(position, "position", where),
        None if reference is None else _signal(reference, "reference", where),
    )
    stamps = None if time is None else _signal(time, "time", where)
    _refuse_lengths(where, **vars(signals), time=stamps)
    return signals, stamps


def _on_a_clock(
    signals: Signals, stamps: Floats | None, period_s: float | None, where: str
) -> tuple[Signals, tuple[Run, ...], tuple[Notice, ...], int]:
    """The signals, when they were recorded, and for how many of their rows the force is held.

    One row for each force, where the period that was said is that of the forces.
    """
    again: tuple[Notice, ...] = ()
    if stamps is not None:
        once, again = rows_read_once(stamps, (signals.force, signals.position))
        signals, stamps = signals[once], stamps[once]
    held = held_for(signals.force)
    each, first = written_each((signals.force,))
    if each > 1 and stamps is not None and _is_period(period_s, stamps, each):
        signals, stamps, held = signals[first::each], stamps[first::each], 1
    runs, paused = runs_on_a_clock(stamps, len(signals.force), period_s, where)
    return signals, runs, (*again, *paused), held


def _jitter(runs: tuple[Run, ...]) -> float | None:
    """That of the run whose clock is the worst; None without stamps."""
    found = [run.timing.jitter for run in runs if run.timing.jitter is not None]
    return max(found) if found else None


def _without_standstill(rows: Rows) -> Rows:
    """Without rows at either end in which the position stands still while the force goes on."""
    force, position = rows.signals.force, rows.signals.position
    start, stop = moving_part(force, position, increment_unit(position) or 0.0)
    return Rows(
        rows.signals[start:stop],
        rows.period_s,
        tuple(joint - start for joint in rows.joints if start < joint < stop),
        rows.notices + left_out(start, stop, len(position)),
    )


def _a_row_a_period(rows: Rows, held: int, stamped: bool, told_s: float | None) -> Rows:
    """One row for each period of the loop; what is held for several rows is said.

    `held` is for how many rows the force is, before any was left out.
    """
    signals, period_s = rows.signals, rows.period_s
    often, first = written_each((signals.force, signals.position))
    if often > 1:
        joints = tuple(-((first - joint) // often) for joint in rows.joints)
        return _once(rows, signals[first::often], float(often), joints)
    # Beside stamps the period that was said is the loop's; else it is that of the rows.
    asked = not (stamped and told_s is not None)
    said: tuple[Notice, ...]
    if held > 1 and asked:
        said = (force_held(signals.force, held, period_s, stamped),)
    elif held == 1 and asked and (mean := held_unevenly(signals.force)) > 1:
        new = new_rows(signals.force, signals.position, mean)
        if new is not None:
            joints = tuple(np.searchsorted(new, rows.joints).tolist())
            return _once(rows, signals[new], mean, joints)
        said = (force_held_unevenly(mean, period_s, stamped),)
    elif (late := held_for(signals.position)) > 1:
        said = (position_held(late, period_s),)
    elif (
        asked
        and not rows.joints
        and (late_by := uneven_rows(signals.force, signals.position, period_s, stamped))
    ):
        said = (late_by,)
    else:
        said = ()
    return replace(rows, notices=rows.notices + said)


def _once(rows: Rows, signals: Signals, often: float, joints: tuple[int, ...]) -> Rows:
    """`signals`, the new rows alone where every row stood so often in the mean."""
    period_s = often * rows.period_s
    return Rows(signals, period_s, joints, (*rows.notices, rows_alike(often, period_s)))


def _in_base_unit(
    signal: Floats, role: str, unit: str | None, where: str
) -> tuple[Floats, str | None, float]:
    """A signal in its role's base unit, that unit, and the factor between them."""
    if unit is None:
        return signal, None, 1.0
    try:
        base, factor = base_unit(role, unit)
    except InputError as error:
        raise InputError(f"{where}: {role}_unit: {error}", topic="units") from None
    if factor != 1.0:
        signal = factor * signal
        signal.setflags(write=False)
    return signal, base, factor


def _is_period(period_s: float | None, stamps: Floats, rows: int) -> bool:
    """Whether the period that was said is that of so many rows, by their stamps."""
    if period_s is None:
        return False
    told = rows * float(np.median(np.diff(stamps)))
    return bool(abs(told - period_s) <= 0.01 * period_s)


def _refuse_lengths(where: str, **signals: Floats | None) -> None:
    """Refuse signals of different lengths, by the names that they have here."""
    lengths = {role: len(signal) for role, signal in signals.items() if signal is not None}
    if len(set(lengths.values())) > 1:
        counts = ", ".join(f"{role} has {length}" for role, length in lengths.items())
        raise InputError(f"{where}: the arrays differ in length: {counts} samples")


def _signal(values: ArrayLike, what: str, where: str) -> NDArray[np.float64]:
    """One signal: a vector of finite numbers of its own, so that nobody changes it from outside."""
    if np.ma.isMaskedArray(values):
        values = np.ma.filled(values.astype(float), np.nan)
    signal = np.squeeze(as_numbers(np.array(values), f"{where}: {what}"))
    if signal.ndim != 1 or signal.size == 0:
        shape = np.shape(values)
        raise InputError(
            f"{where}: {what} must be one row of two samples or more, not an array of shape {shape}"
        )
    bad = np.flatnonzero(~np.isfinite(signal))
    if len(bad):
        start, stop = longest(np.isfinite(signal))
        raise InputError(
            f"{where}: {what} is {signal[bad[0]]} in row {bad[0] + 1} ({such(len(bad), 'row')}); "
            "remove them (few in one place are put back by their times, where many were another "
            f"piece begins), or read the longest part without, --rows {start + 1}:{stop}",
            topic="rows",
        )
    signal.setflags(write=False)
    return signal
