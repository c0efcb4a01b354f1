"""A study: one device and all its recordings, as a TOML file says."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from bayeshaptic.devices import Device
from bayeshaptic.errors import InputError, Notice
from bayeshaptic.recordings.cut import Span
from bayeshaptic.recordings.feedback import Feedback
from bayeshaptic.recordings.join import join_recordings, same_period
from bayeshaptic.recordings.known_limits import KnownLimit
from bayeshaptic.recordings.measurement import read_measurement
from bayeshaptic.recordings.read import Columns
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.shown import Shown, listed


@dataclass(frozen=True)
class StudyEntry:
    """One ``[[recording]]`` table of a study.

    Attributes
    ----------
    path : Path
    user : str or None
        Nobody holds the device where it is None.
    configuration : float or str or None
        A coordinate, or a name.
    trial : int or str or None
    level : float or None
        Excitation level.
    columns : str, mapping or None
        This file's own mapping; None means the device's.
    rows, seconds : (float, float) or None
        The part to read; see `read_recording`.
    more : tuple of StudyEntry
        Further recordings of the same: they count together with this one, as its pieces.
    """

    path: Path
    user: str | None = None
    configuration: float | str | None = None
    trial: int | str | None = None
    level: float | None = None
    columns: Columns = field(default=None, hash=False)
    rows: Span | None = None
    seconds: Span | None = None
    more: tuple[StudyEntry, ...] = ()


@dataclass(frozen=True, repr=False)
class Study(Shown):
    """One device: its facts and all its recordings.

    Attributes
    ----------
    name : str
        The study file's name.
    path : Path
    device : Device
    columns : str, mapping or None
        Mapping of the recordings' columns.
    prior : mapping of str to mapping of str to float (or bool)
        By parameter name, for example ``{"m1": {"median": 0.2, "log_sd": 0.3}}``; see `read_study`.
    effects : mapping of str to float
        Prior probabilities of effects that hide, by their names.
    entries : tuple of StudyEntry
    notices : tuple of Notice
    references : tuple of KnownLimit
        Limits known from elsewhere, to compare with.
    feedback : Feedback or None
        The controller that was in the loop while all of them were made.
    """

    name: str
    path: Path
    device: Device
    entries: tuple[StudyEntry, ...]
    columns: Columns = field(default=None, hash=False)
    prior: Mapping[str, Mapping[str, float | bool]] = field(default_factory=dict, hash=False)
    effects: Mapping[str, float] = field(default_factory=dict, hash=False)
    notices: tuple[Notice, ...] = ()
    references: tuple[KnownLimit, ...] = ()
    feedback: Feedback | None = None

    def _lines(self) -> tuple[str, ...]:
        places = dict.fromkeys(one.configuration for one in self.entries)
        return (
            f"Study {self.name} of the device {self.device.name}: {len(self.entries)} recordings",
            f"held by {listed(self.users)}" if self.users else "held by nobody",
            f"configurations: {listed(str(p) for p in places if p is not None) or 'none named'}",
        )

    @property
    def users(self) -> tuple[str, ...]:
        """Users in the order in which they first appear."""
        return tuple(dict.fromkeys(entry.user for entry in self.entries if entry.user is not None))

    @property
    def files(self) -> tuple[Path, ...]:
        """All that its entries name."""
        return tuple(one.path for entry in self.entries for one in (entry, *entry.more))

    def read(self, entry: StudyEntry) -> Recording | Etfe:
        """The measurement of one `entry`, with what the study declares about it.

        Time stamps come before the device's period, which serves where a file has none. What
        counts together is joined (`join_recordings`), less what cannot be read.

        Raises
        ------
        InputError
            See `read_measurement` and `join_recordings`.
        """
        if not entry.more:
            return self._read_one(entry)
        found, lost = [], []
        for one in (entry, *entry.more):
            try:
                measured = self._read_one(one)
            except InputError as error:
                lost.append(error)
                continue
            if isinstance(measured, Recording):
                found.append(measured)
            else:
                lost.append(
                    InputError(
                        f"{self.path}: {one.path.name} is a table of a response, which cannot be "
                        "joined; with pool = false at the top of the study each has a report"
                    )
                )
        if not found:
            raise lost[0]
        joined = join_recordings(found)
        if not lost:
            return joined
        why = "; ".join(str(error) for error in lost)
        text = (
            f"{len(lost)} of {len(found) + len(lost)} recordings that count as one left out: {why}"
        )
        return replace(joined, notices=(*joined.notices, Notice("warning", "pieces", text)))

    def with_periods_apart(self) -> Study:
        """The study in which nothing counts together that was sampled at another rate.

        For this what counts together is read.  What cannot be read stays with the first.
        """
        found = [one for entry in self.entries for one in self._of_each_period(entry)]
        return replace(self, entries=tuple(found))

    def _of_each_period(self, entry: StudyEntry) -> list[StudyEntry]:
        """What an entry counts together, an entry for each sampling period."""
        if not entry.more:
            return [entry]
        groups: dict[float, list[StudyEntry]] = {}
        lost = []
        for one in (replace(entry, more=()), *entry.more):
            try:
                period_s = self._read_one(one).period_s
            except InputError:
                lost.append(one)
                continue
            known = (other for other in groups if same_period(period_s, other))
            groups.setdefault(next(known, period_s), []).append(one)
        if len(groups) < 2:
            return [entry]
        first, *others = groups.values()
        return [replace(one, more=tuple(more)) for one, *more in ([*first, *lost], *others)]

    def _read_one(self, entry: StudyEntry) -> Recording | Etfe:
        columns = entry.columns if entry.columns is not None else self.columns
        measurement = read_measurement(
            entry.path,
            columns=columns,
            encoder_resolution=self.device.encoder_resolution,
            kind=self.device.kind,
            default_period_s=self.device.period_s,
            rows=entry.rows,
            seconds=entry.seconds,
        )
        if not isinstance(measurement, Recording):
            return measurement
        return replace(
            measurement,
            device=self.device.name,
            user=entry.user,
            configuration=entry.configuration,
            trial=entry.trial,
            level=entry.level,
            feedback=self.feedback,
        )

    def read_all(self) -> tuple[Recording | Etfe, ...]:
        """The measurements of all entries, in their order."""
        return tuple(self.read(entry) for entry in self.entries)
