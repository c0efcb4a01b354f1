"""The limits as a table that a rendering program can load: `limits.json` and `limits.csv`."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from bayeshaptic.arguments import at_the_door
from bayeshaptic.files import write_text
from bayeshaptic.quantities import percent, rounded_down
from bayeshaptic.shown import Shown, data_frame
from bayeshaptic.stability.cases import Case, DeviceLimit, device_limit
from bayeshaptic.stability.critical import CriticalStiffness
from bayeshaptic.stability.tail import quantiles
from bayeshaptic.stability.walls.damping import Damping
from bayeshaptic.stability.walls.filter_limits import FilterLimits, filter_limits
from bayeshaptic.stability.walls.joint import filtered, joint_region, usual_dampings
from bayeshaptic.stability.walls.region import DRAWS
from bayeshaptic.types import Floats
from bayeshaptic.version import __version__

RISKS = (0.05, 0.01, 0.001)
_FORMAT = "bayeshaptic limits 1"


@dataclass(frozen=True, eq=False, repr=False)
class LimitTable(Shown):
    """Limits at given risks over the cases of a device.

    Attributes
    ----------
    cases : tuple of Case
    risks : tuple of float
    samples : ndarray, shape (n,)
        K_CR of the joint draws over all cases, without damping.
    stiffness : tuple of float or None
        The stiffness without damping at each risk, over all cases.
    by_case : tuple of tuple of float or None
        The same of each case.
    filters : tuple of FilterLimits
    reason : str or None
        Why no limit is stated: then every stiffness in the files is missing.
    """

    cases: tuple[Case, ...] = field(repr=False)
    risks: tuple[float, ...]
    samples: Floats = field(repr=False)
    stiffness: tuple[float | None, ...]
    by_case: tuple[tuple[float | None, ...], ...]
    filters: tuple[FilterLimits, ...]
    reason: str | None = None

    @property
    def unit(self) -> str:
        return self.cases[0].limit.unit

    @property
    def damping_unit(self) -> str:
        return self.filters[0].region.damping_unit

    def as_dict(
        self,
        device: str | None = None,
        status: str | None = None,
        recommended: float | None = None,
    ) -> dict[str, Any]:
        """What `limits.json` holds, see docs/file-formats.md.

        Parameters
        ----------
        device : str, optional
        status : {"safe", "caution", "untrusted"}, optional
            What the report says of these numbers.
        recommended : float, optional
            The stiffness that the report recommends, which may be below what the model says.
        """
        return {
            "format": _FORMAT,
            "version": __version__,
            "device": device,
            "status": status,
            "reason": self.reason,
            "recommended": recommended,
            "period_s": self.filters[0].region.period_s,
            "stiffness_unit": self.unit,
            "damping_unit": self.damping_unit,
            "stiffness": self._by_risk(self.stiffness),
            "cases": [
                {"label": case.label, "group": case.group, "stiffness": self._by_risk(values)}
                for case, values in zip(self.cases, self.by_case, strict=True)
            ],
            "boundaries": [self._boundary(part) for part in self.filters],
        }

    def as_json(
        self,
        device: str | None = None,
        status: str | None = None,
        recommended: float | None = None,
    ) -> str:
        """`as_dict` of `device`, `status` and `recommended` as text; strict JSON."""
        found = self.as_dict(device, status, recommended)
        return json.dumps(found, indent=1, allow_nan=False) + "\n"

    def as_csv(self) -> str:
        """One row a filter and damping; the units stand in the names of the columns."""
        stiffness, damping = (_in_a_name(unit) for unit in (self.unit, self.damping_unit))
        heads = ["damping_filter", "cutoff_hz", "smoothing", f"damping_{damping}"]
        heads += [f"stiffness_{stiffness}_at_risk_{risk:g}" for risk in self.risks]
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(heads)
        for part in map(self._boundary, self.filters):
            columns = [part["stiffness"][f"{risk:g}"] for risk in self.risks]
            for number, level in enumerate(part["damping"]):
                values = ["" if c is None else c[number] for c in columns]
                cutoff = "" if part["cutoff_hz"] is None else part["cutoff_hz"]
                writer.writerow([part["damping_filter"], cutoff, part["smoothing"], level, *values])
        return text.getvalue()

    @at_the_door
    def write(
        self,
        folder: str | Path,
        device: str | None = None,
        status: str | None = None,
        recommended: float | None = None,
    ) -> None:
        """Write limits.json and limits.csv.

        Parameters
        ----------
        folder : str or Path
            Which is there.
        device, status, recommended : optional
            As in `as_dict`.
        """
        for name, text in (
            ("limits.csv", self.as_csv()),
            ("limits.json", self.as_json(device, status, recommended)),
        ):
            write_text(Path(folder) / name, text)

    def _by_risk(self, values: Sequence[float | None]) -> dict[str, float | None]:
        stated = values if self.reason is None else [None] * len(values)
        return {f"{r:g}": _plain(v) for r, v in zip(self.risks, stated, strict=True)}

    def _boundary(self, part: FilterLimits) -> dict[str, Any]:
        stated = self.reason is None
        found = {f"{risk:g}": part.boundary(risk) if stated else None for risk in self.risks}
        return {
            "damping_filter": "backward" if part.kind.cutoff_hz is None else "low_pass",
            "cutoff_hz": part.kind.cutoff_hz,
            "smoothing": part.kind.smoothing(part.region.period_s),
            "damping": [_plain(level) for level in part.damping],
            "stiffness": {
                risk: None if b is None else [_plain(value) for value in b.stiffness]
                for risk, b in found.items()
            },
        }

    def to_dataframe(self) -> Any:
        """A ``pandas.DataFrame``, a row a way to get the velocity, a damping and a risk."""
        return data_frame(
            {
                "velocity": part.kind.label,
                "damping": float(damping),
                "damping_unit": self.damping_unit,
                "risk": risk,
                "stiffness": float(stiffness),
                "stiffness_unit": self.unit,
            }
            for part in self.filters
            for risk in self.risks
            if (boundary := part.boundary(risk)) is not None
            for damping, stiffness in zip(boundary.damping, boundary.stiffness, strict=True)
        )

    def _lines(self) -> tuple[str, ...]:
        low, high = (float(end) for end in quantiles(self.samples, (0.05, 0.95)))
        stated = [
            f"{rounded_down(value, self.unit, low, high).text} at {percent(risk)}"
            for risk, value in zip(self.risks, self.stiffness, strict=True)
            if value is not None
        ]
        return (
            f"Limits of walls over {len(self.cases)} case{'s' if len(self.cases) > 1 else ''}",
            f"without damping: {', '.join(stated) or 'too few draws to say'}",
            f"with damping, velocity by: {', '.join(part.kind.label for part in self.filters)}",
        )


@at_the_door
def limit_table(
    cases: Sequence[Case],
    dampings: Sequence[Damping] | None = None,
    risks: tuple[float, ...] = RISKS,
    draws: int = DRAWS,
    seed: int = 0,
    limit: DeviceLimit | CriticalStiffness | None = None,
) -> LimitTable:
    """The limits of a device over its cases, without damping and with it.

    Parameters
    ----------
    cases : sequence of Case
        One for a single recording.
    dampings : sequence of Backward or LowPass, optional
        By default the backward difference, and a low-pass at a tenth of the sampling rate.
    risks : tuple of float
    draws : int
        Of each case for the boundaries over damping.
    seed : int
    limit : DeviceLimit or CriticalStiffness, optional
        Of all cases together, where it is known already.

    Returns
    -------
    LimitTable

    Raises
    ------
    InputError
        Without cases, or where they have different units.
    """
    cases = tuple(cases)
    over_all = limit
    if over_all is None:
        over_all = device_limit(cases, seed=seed) if len(cases) != 1 else cases[0].limit
    stated = tuple(over_all.safe(risk) for risk in risks)
    undamped = dict(zip(risks, stated, strict=True))
    region = joint_region(cases, draws=draws)
    kinds = usual_dampings(region.period_s) if dampings is None else tuple(dampings)
    return LimitTable(
        cases,
        risks,
        over_all.samples,
        stated,
        tuple(tuple(case.limit.safe(risk) for risk in risks) for case in cases),
        tuple(
            replace(filter_limits(cases, filtered(region, kind), risks, draws), undamped=undamped)
            for kind in kinds
        ),
    )


def _plain(value: float | None) -> float | None:
    if value is None or not math.isfinite(value):
        return None
    digits = 6
    return float(f"{value:.{digits}g}")


def _in_a_name(unit: str) -> str:
    """ "N s/m" as "N_s_per_m"."""
    return unit.replace("/", "_per_").replace(" ", "_")
