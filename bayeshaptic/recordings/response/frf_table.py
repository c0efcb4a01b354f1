"""A frequency response without its recording: a table of gain, phase and uncertainty."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.arguments import at_the_door
from bayeshaptic.errors import InputError, Notice
from bayeshaptic.recordings.columns import FRF_KINDS, FRF_ROLES, Column, parse_columns, pick
from bayeshaptic.recordings.readers import Arrays, read_arrays
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.recordings.response.frf_kinds import (
    PER_TIME,
    STRUCTURAL,
    as_held,
    told,
    with_images_allowed_for,
)
from bayeshaptic.recordings.response.table_rounding import relative_variance, within_half_a_digit
from bayeshaptic.recordings.response.table_spectra import TableSpectra
from bayeshaptic.recordings.units import base_unit, choose_units
from bayeshaptic.types import Complexes

FEWEST_ROWS = 10


@at_the_door
def read_frf(
    path: str | os.PathLike[str],
    period_s: float | None = None,
    columns: str | Mapping[str, str] | None = None,
    force_unit: str | None = None,
    position_unit: str | None = None,
    kind: str | None = None,
) -> Etfe:
    r"""A measured frequency response from a table.

    Columns (a header, or `columns` names them): ``frequency_hz``, ``gain_db`` (20 log10 of position
    over force, in base units), ``phase_deg``, and one of

    - ``sd``: the standard deviation of the complex response in absolute units (position over
      force, not dB): :math:`\sqrt{E|\hat G - G|^2}`, real and imaginary part together. It is
      taken as known.
    - ``coherence`` and ``averages``, the sample coherence and the number of independent segments
      behind it (a column, or one number). With n averages the scatter about the estimate has
      n - 1 complex degrees of freedom, hence without bias

      .. math:: E|\hat G - G|^2 = |\hat G|^2 (1 - \gamma^2) / (\gamma^2 (n - 1))

      (for large n Bendat and Piersol, *Random Data*, section 9.2: their relative error of the
      magnitude, :math:`\sqrt{1 - \gamma^2} / (|\gamma| \sqrt{2 n})`, is one of two components).
      A coherence that was rounded to 1 is taken half of its last digit lower.

    What rounding to the digits of gain and phase leaves open is added to the variance.

    ``receptance_db``, ``mobility_db`` or ``accelerance_db`` (position, velocity or acceleration
    over a measured force) in the place of ``gain_db`` say that the response is that of a continuous
    structure, as a hammer or a shaker finds it: it is turned into that of a loop with a hold.

    Parameters
    ----------
    path : str or path
    period_s : float
        Sampling period of the loop, which a table cannot say.
    columns : str, mapping or None
        ``"frequency=f,gain_db=mag,phase_deg=ph,coherence=coh,averages=n"``; the gain's unit,
        position over force, may be written: ``gain_db=mag[rad/A]``; `sd` is then in that unit too.
    force_unit : {"N", "Nm", "A"} or None
    position_unit : {"m", "rad"} or None
    kind : {"translational", "rotational"} or None
        Decides where no units are given.

    Returns
    -------
    Etfe
        With the rows in the order of their frequencies.

    Raises
    ------
    InputError
        For missing columns, NaN, frequencies that repeat or lie beyond the Nyquist frequency,
        impossible standard deviations, coherences and averages, and fewer than ten rows.
    """
    path = Path(path)
    arrays, mapping = read_arrays(path), parse_columns(columns)
    return frf_from_arrays(path, arrays, mapping, period_s, force_unit, position_unit, kind)


def frf_from_arrays(
    path: Path,
    arrays: Arrays,
    mapping: Mapping[str, Column],
    period_s: float | None,
    force_unit: str | None = None,
    position_unit: str | None = None,
    kind: str | None = None,
) -> Etfe:
    """`read_frf` for a file whose arrays and mapping are there already."""
    if period_s is None:
        raise InputError(
            f"{path}: a frequency response does not say the loop's sampling period; give --period-s"
        )
    if not (np.isfinite(period_s) and period_s > 0):
        raise InputError(f"{path}: the period must be a number of seconds above 0, not {period_s}")
    columns, left_out = _columns(path, arrays, mapping, 0.5 / period_s)
    (of,) = (role for role in FRF_KINDS if role in columns)
    frequency = columns["frequency"]
    _check_frequencies(path, frequency, period_s)
    factor = 1.0
    written = mapping[of].unit if of in mapping else None
    if written is not None:
        derivatives = STRUCTURAL.get(of, 0)
        position_unit, force_unit, factor = _units_of_gain(path, written, derivatives)
    units = choose_units(force_unit, position_unit, kind, str(path))
    notices: tuple[Notice, ...] = ()
    if force_unit is None and position_unit is None:
        text = f"No units were given: the gain is taken to be in {units[1]}/{units[0]}."
        notices = (Notice("note", "units", text, ("force", "position")),)
    notices += left_out
    if of in STRUCTURAL:
        notices += (told(of),)
    found = _spectra(path, columns, of, period_s)
    own = None if found.own_variance is None else found.own_variance * factor**2
    value, variance = found.value * factor, found.variance * factor**2
    spectra = TableSpectra(frequency, value, variance, found.averages, own)
    return Etfe(
        frequency_hz=frequency,
        value=spectra.value,
        variance=spectra.variance,
        coherence=columns.get("coherence", np.full(len(value), np.nan)),
        period_s=float(period_s),
        band_hz=(float(frequency[0]), float(frequency[-1])),
        force_unit=units[0],
        position_unit=units[1],
        spectra=spectra,
        notices=notices,
    )


def _spectra(
    path: Path, columns: Mapping[str, NDArray[np.float64]], of: str, period_s: float
) -> TableSpectra:
    """The response of a table in its own units, sampled and held as in a loop of this period."""
    frequency = columns["frequency"]
    phase = np.exp(1j * np.radians(columns["phase_deg"]))
    value: Complexes = np.asarray(10 ** (columns[of] / 20) * phase)
    variance, averages = _variance(path, columns, value)
    variance = variance + np.abs(value) ** 2 * relative_variance(columns[of], columns["phase_deg"])
    if of not in STRUCTURAL:
        return TableSpectra(frequency, value, variance, averages)
    value, own = as_held(value, variance, frequency, period_s, STRUCTURAL[of])
    variance = with_images_allowed_for(value, own, frequency, period_s)
    return TableSpectra(frequency, value, variance, averages, own)


def _columns(
    path: Path, arrays: Arrays, mapping: Mapping[str, Column], nyquist_hz: float
) -> tuple[dict[str, NDArray[np.float64]], tuple[Notice, ...]]:
    """The table's columns by role, finite and equally long, in the order of the frequencies.

    A single number fills its column.  And what is said of rows that are not used.
    """
    for role in set(mapping) - set(FRF_ROLES):
        raise InputError(f"{path}: '{role}' belongs to a recording, not to a frequency response")
    columns: dict[str, NDArray[np.float64]] = {}
    for role in FRF_ROLES:
        found = pick(arrays, role, mapping, path, required=role in ("frequency", "phase_deg"))
        if found is not None:
            columns[role] = found[0]
    kinds = [role for role in FRF_KINDS if role in columns]
    if len(kinds) != 1:
        there = " and ".join(kinds) or "none"
        raise InputError(
            f"{path}: the response needs one column of {', '.join(FRF_KINDS)}; there is {there}; "
            "name it, as in --columns gain_db=mag[m/N]"
        )
    if "sd" not in columns and not {"coherence", "averages"} <= set(columns):
        there = "coherence without averages" if "coherence" in columns else "neither"
        raise InputError(
            f"{path}: the response needs its uncertainty, a column sd or the columns coherence and "
            f"averages; there is {there}"
        )
    frequency = columns["frequency"]
    used, notices = _used(frequency, kinds[0] in STRUCTURAL, nyquist_hz)
    for role, values in columns.items():
        if len(values) not in (1, len(used)):
            raise InputError(f"{path}: {role} has {len(values)} rows, frequency has {len(used)}")
        values = np.broadcast_to(values, len(used))
        bad = np.flatnonzero(used & ~np.isfinite(values))
        if len(bad):
            raise InputError(f"{path}: {role} is {values[bad[0]]} in row {bad[0] + 1}")
        columns[role] = values[used]
    if (rows := int(used.sum())) < FEWEST_ROWS:
        raise InputError(f"{path}: {rows} rows; a model needs at least {FEWEST_ROWS} frequencies")
    order = np.argsort(columns["frequency"], kind="stable")
    return {role: values[order] for role, values in columns.items()}, notices


def _used(
    frequency: NDArray[np.float64], of_a_structure: bool, nyquist_hz: float
) -> tuple[NDArray[np.bool_], tuple[Notice, ...]]:
    """Which rows tell something of the loop, and what is said of the others.

    Analysers write a line at 0 Hz, and a structure is measured as far up as it vibrates.
    """
    still = frequency == 0
    beyond = of_a_structure & (frequency > nyquist_hz * (1 + 1e-9))
    found = [f"{still.sum()} at 0 Hz"] if still.any() else []
    if beyond.any():
        found.append(f"{beyond.sum()} above half the sampling rate, {nyquist_hz:g} Hz")
    text = f"Rows of the table that are not used: {' and '.join(found)}."
    return ~(still | beyond), (Notice("note", "band", text),) if found else ()


def _check_frequencies(path: Path, frequency: NDArray[np.float64], period_s: float) -> None:
    nyquist = 0.5 / period_s
    bad = np.flatnonzero((frequency <= 0) | (frequency > nyquist * (1 + 1e-9)))
    if len(bad):
        raise InputError(
            f"{path}: frequency {frequency[bad[0]]:g} Hz is not above 0 and up to the Nyquist "
            f"frequency, {nyquist:g} Hz at a period of {period_s:g} s; remove such rows "
            f"({len(bad)})"
        )
    twice = np.flatnonzero(np.diff(frequency) == 0)
    if len(twice):
        raise InputError(
            f"{path}: frequency {frequency[twice[0]]:g} Hz is there twice; average the rows, or "
            "remove one"
        )


def _variance(
    path: Path, columns: Mapping[str, NDArray[np.float64]], value: NDArray[Any]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Complex variance of the response, and the averages behind it."""

    def check(role: str, good: NDArray[np.bool_], expected: str) -> None:
        bad = np.flatnonzero(~good)
        if len(bad):
            raise InputError(
                f"{path}: {role} is {columns[role][bad[0]]:g} at {columns['frequency'][bad[0]]:g} "
                f"Hz; it must be {expected}"
            )

    if "sd" in columns:
        check("sd", columns["sd"] > 0, "above 0 (position over force, not dB)")
        return columns["sd"] ** 2, np.full(len(value), np.inf)
    coherence, averages = within_half_a_digit(columns["coherence"]), columns["averages"]
    expected = "between 0 and 1; where no digit of it is less than 1, give a column sd"
    check("coherence", (coherence > 0) & (coherence < 1), expected)
    check("averages", averages >= 2, "at least 2, or the scatter cannot be known")
    return np.abs(value) ** 2 * (1 - coherence) / (coherence * (averages - 1)), averages


def _units_of_gain(path: Path, written: str, derivatives: int) -> tuple[str, str, float]:
    """Base units of position and force, and the factor to them, for ``mm/N`` and the like."""
    motion, slash, force = written.replace(" ", "").rpartition("/")
    endings = [end for end in PER_TIME[derivatives] if motion.endswith(end)]
    if not (slash and endings):
        what = ("position", "velocity", "acceleration")[derivatives]
        raise InputError(
            f"{path}: the gain's unit is {what} over force, as in [m{PER_TIME[derivatives][0]}/N], "
            f"not [{written}]"
        )
    position = motion.removesuffix(endings[0])
    position_unit, position_factor = base_unit("position", position)
    force_unit, force_factor = base_unit("force", force)
    return position_unit, force_unit, position_factor / force_factor
