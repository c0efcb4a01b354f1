"""A recording from arrays in memory: their lengths, values, times and units are checked here."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bayeshaptic.arguments import at_the_door
from bayeshaptic.errors import InputError, Notice
from bayeshaptic.quantities import quantity
from bayeshaptic.recordings.readers.numbers import as_numbers
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.signals.raw_signals import increment_unit
from bayeshaptic.recordings.signals.runs import held_for, moving_part, written_each
from bayeshaptic.recordings.signals.timing import LOOP, sampling_period
from bayeshaptic.recordings.signals.turns import unwrapped, without_jumps
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
    force = _signal(force, "force", where)
    position = _signal(position, "position", where)
    stamps = None if time is None else _signal(time, "time", where)
    followed = None if reference is None else _signal(reference, "reference", where)
    _refuse_lengths(where, force=force, position=position, reference=followed, time=stamps)
    if not (encoder_resolution is None or 0 < encoder_resolution < np.inf):
        raise InputError(f"{where}: encoder_resolution must be above 0, not {encoder_resolution}")
    if time is None and period_s is None and source is None:
        raise InputError(f"{where}: no time and no period; give period_s in seconds, or time")
    force, force_unit, _ = _in_base_unit(force, "force", force_unit, where)
    position, position_unit, factor = _in_base_unit(position, "position", position_unit, where)
    encoder_resolution = None if encoder_resolution is None else factor * encoder_resolution
    held, signals = held_for(force), _Signals(force, position, followed)
    each, first = written_each((force,))
    if each > 1 and stamps is not None and _is_period(period_s, stamps, each):
        signals, stamps, held = signals[first::each], stamps[first::each], 1
    timing = sampling_period(stamps, period_s, where)
    unit_of_force, unit_of_position = choose_units(force_unit, position_unit, kind, where)
    angle = unit_of_position == "rad"
    position, notices = unwrapped(signals.position, angle, encoder_resolution, where)
    signals = replace(signals, position=position)
    if timing.rows is not None:
        from bayeshaptic.recordings.signals.gaps import put_back

        every = put_back(signals.force, position, signals.reference, timing.rows, where)
        signals = _Signals(*every)
    position, joints, jumps = without_jumps(signals.position, signals.force)
    start, stop = moving_part(signals.force, position, increment_unit(position) or 0.0)
    notices += (*timing.notices, *jumps, *_at_rest(start, stop, len(position)))
    signals = replace(signals, position=position)[start:stop]
    often, first = written_each((signals.force, signals.position))
    loop_s = often * timing.period_s
    skipped = first % often if often > 1 else 0
    joints = tuple(
        -((start + skipped - joint) // often) for joint in joints if start < joint < stop
    )
    if often > 1:
        signals = signals[skipped::often]
        notices += (_written_each(often, loop_s),)
    elif held > 1 and (stamps is None or period_s is None):
        notices += (_held(signals.force, held, loop_s, stamps is not None),)
    elif (late := held_for(signals.position)) > 1:
        notices += (_read_late(late, loop_s),)
    notices += assumed_units(force_unit, position_unit, unit_of_force, unit_of_position)
    return Recording(
        **vars(signals),
        period_s=loop_s,
        force_unit=unit_of_force,
        position_unit=unit_of_position,
        name=name,
        encoder_resolution=encoder_resolution,
        time_jitter=timing.jitter,
        source=source,
        notices=notices,
        joints=joints,
    )


@dataclass(frozen=True)
class _Signals:
    """What is recorded at each sample; the reference where there is one."""

    force: Floats
    position: Floats
    reference: Floats | None

    def __getitem__(self, rows: slice) -> _Signals:
        followed = None if self.reference is None else self.reference[rows]
        return _Signals(self.force[rows], self.position[rows], followed)


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


def _held(force: Floats, rows: int, period_s: float, stamped: bool) -> Notice:
    """A loop of a longer period than the rows have, or an excitation that was held."""
    slower, each = quantity(rows * period_s, "s"), f"one row in {rows}"
    levels = len(np.unique(force)) > 2  # two are those of a clock that people choose
    cure = (
        f"Say which it is: --period-s {rows * period_s:.6g} for the loop of these changes, of "
        f"which {each} is then read, or --period-s {period_s:.6g} where the loop runs at every row "
        "and the excitation alone was held."
        if stamped
        else f"If so, keep {each} alone, those at which the force changes, and say the period of "
        "these."
    )
    text = (
        f"The force is held for {rows} rows, and the position changes in between: as where a drive "
        f"writes rows faster than its loop commands forces. That loop's period is {slower}, and "
        f"its limit is lower than that of one of {quantity(period_s, 's')}. {cure}"
    )
    return Notice("warning", "period", text, (LOOP,) if levels and stamped else ())


def _read_late(rows: int, period_s: float) -> Notice:
    text = (
        f"The position is held for {rows} rows, {quantity(rows * period_s, 's')}, while the force "
        "changes in between: as where it is read more slowly than forces are commanded. The limit "
        "is that of a loop that sees it so late. If the loop sees a new position at every row, "
        "record that one: then the limit is higher."
    )
    return Notice("warning", "held position", text)


def _at_rest(start: int, stop: int, samples: int) -> tuple[Notice, ...]:
    if (start, stop) == (0, samples):
        return ()
    ends = [f"{a + 1} to {b}" for a, b in ((0, start), (stop, samples)) if b > a]
    text = (
        f"The position stands still in rows {' and '.join(ends)} while the force goes on, as "
        "before an amplifier is switched on, after it is switched off, or behind a brake: these "
        "rows were left out."
    )
    return (Notice("warning", "standstill", text),)


def _written_each(often: int, period_s: float) -> Notice:
    text = (
        f"Every row stands {often} times in a row, as where a log is faster than the loop: one of "
        f"each was read, and the loop's period is taken to be {quantity(period_s, 's')}. Say "
        "otherwise with --period-s, which is that of a row."
    )
    return Notice("note", "time stamps", text)


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
        raise InputError(
            f"{where}: {what} is {signal[bad[0]]} in row {bad[0] + 1} ({len(bad)} such rows); "
            "fill them in, or read a part without them, with --rows A:B",
            topic="rows",
        )
    signal.setflags(write=False)
    return signal
