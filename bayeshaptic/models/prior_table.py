"""Priors as a study's file declares them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from bayeshaptic.errors import InputError, nearest_or_all
from bayeshaptic.models.prior import HalfNormal, LogNormal, LogUniform, Normal, Prior, Uniform
from bayeshaptic.models.prior_of_zero import MaybeZero, NearZero
from bayeshaptic.models.structures import structure_named

_FORMS: dict[frozenset[str], type] = {
    frozenset({"median", "log_sd"}): LogNormal,
    frozenset({"scale"}): HalfNormal,
    frozenset({"scale", "floor"}): NearZero,
    frozenset({"scale", "floor", "rise"}): NearZero,
    frozenset({"scale", "seen"}): MaybeZero,
    frozenset({"scale", "seen", "weight"}): MaybeZero,
    frozenset({"mean", "sd"}): Normal,
    frozenset({"mean", "sd", "low"}): Normal,
    frozenset({"low", "high"}): Uniform,
}


def prior_from_table(name: str, table: Mapping[str, object]) -> Prior:
    """The prior that a ``[prior]`` table of a study declares for the parameter `name`.

    ``{median, log_sd}`` is log-normal, ``{scale}`` half-normal, ``{scale, floor}`` (and ``rise``)
    near zero, ``{scale, seen}`` (and ``weight``) half-normal or zero, ``{mean, sd}`` (and ``low``)
    normal, ``{low, high}`` uniform, and ``{low, high, log = true}`` log-uniform.

    Raises
    ------
    InputError
        If the keys fit none of these forms, or a value is not a number in range.
    """
    keys = dict(table)
    log = keys.pop("log", False)
    form = _FORMS.get(frozenset(keys))
    if form is None:
        raise InputError(
            f"prior of {name}: keys {sorted(table)} fit no prior; use {{median, log_sd}}, "
            "{scale}, {scale, floor}, {scale, seen}, {mean, sd}, {low, high} or {low, high, log = "
            "true}."
        )
    try:
        numbers = {key: float(value) for key, value in keys.items()}  # type: ignore[arg-type]
        return LogUniform(**numbers) if log and form is Uniform else form(**numbers)
    except (TypeError, ValueError) as problem:
        raise InputError(f"prior of {name}: {problem}") from None


def refuse_unknown(prior: Iterable[str], models: Iterable[str]) -> None:
    """Refuse priors by names that are parameters of none of the models: they would do nothing.

    Raises
    ------
    InputError
        With the nearest name.
    """
    structures = [structure_named(model) for model in models]
    known = [
        *dict.fromkeys(name for one in structures for name in one.names),
        "delay_s",
        "force_lag_s",
    ]
    for name in prior:
        if name not in known:
            raise InputError(
                f"prior: no model has a parameter {name!r}{nearest_or_all(name, known)}"
            )
