"""How a measurement is analysed: the options of `analyse`, of `close_loop`, of studies and jobs.

Each option is described here and nowhere else: the command line takes its help from the docstring
of the class.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from bayeshaptic.arguments import check_fields, instance
from bayeshaptic.devices import Device
from bayeshaptic.errors import InputError, nearest_or_all, shown
from bayeshaptic.numerics.spending import BUDGET_S
from bayeshaptic.progress import told

if TYPE_CHECKING:
    from bayeshaptic.models.prior import Prior
    from bayeshaptic.types import Progress


@dataclass(frozen=True)
class Options:
    """How a measurement is analysed.

    Attributes
    ----------
    device : str, Path, Device or None
        Device file with priors and delay: lhifam, phantom, or the path of a TOML file; by default
        what the model, the recording or the study names, or no device.
    delay_s : float or None
        Loop delay in seconds, beyond the hold; by default the device's, or inferred.
    delay_sd_s : float or None
        Standard deviation of the delay in seconds, 0 where it is known exactly; by default the
        device's.
    band_hz : (float, float) or None
        Lowest and highest frequency used, in Hz; by default chosen from the data.
    prior : mapping
        Your own priors by parameter name.
    held : bool or None
        Whether somebody held the device: the base model is then chosen among those of held, or of
        free, devices; by default from the data, in a study from its users.
    modes : int or None
        Vibration modes of the device: 0 is one rigid mass, 1 two masses and a transmission, N a
        chain of N + 1 masses, 8 modes at most; nobody holds it, or with `held` a user by its last
        mass. By default chosen from the data.
    lever_m : float or None
        From the axis to the tip, in metres; by default the device's.
    ess : float or None
        Effective draws of every parameter; by default what the limit wants
        (`bayeshaptic.diagnosis.limit_known`).
    hidden : bool
        Whether the limit allows for effects that are too small to be seen; by default it does.
    effects : mapping
        Prior probability of each of these, by its name; "each" is that of the others, 0.08.
    seed : int
        Of the sampler: the same seed gives the same report; by default 0.
    budget_s : float
        What looking for what the model lacks may cost, in nominal seconds: evaluations are counted,
        so that the verdict is the same on every machine; by default 40.
    checkpoints : path or None
        Folder in which samplers that run for longer than some ten seconds keep their state, to go
        on after an interruption; by default none, and the report's own in commands.
    progress : callable, bool or None
        Called with the share done, 0 to 1, and a word about it; True draws a bar.
    """

    device: str | Path | Device | None = None
    delay_s: float | None = None
    delay_sd_s: float | None = None
    band_hz: tuple[float, float] | None = None
    prior: Mapping[str, Prior] = field(default_factory=dict, hash=False)
    held: bool | None = None
    modes: int | None = None
    lever_m: float | None = None
    ess: float | None = None
    hidden: bool = True
    effects: Mapping[str, float] = field(default_factory=dict, hash=False)
    seed: int = 0
    budget_s: float = BUDGET_S
    checkpoints: str | Path | None = field(default=None, compare=False)
    progress: Progress | bool | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        if self.prior is None:
            object.__setattr__(self, "prior", {})
        check_fields(self, _names() if self.prior else globals())
        if self.band_hz is not None and not 0 <= self.band_hz[0] < self.band_hz[1]:
            raise InputError(
                f"band_hz is {shown(self.band_hz)}; give the lower one first, as in (0.7, 200)"
            )
        object.__setattr__(self, "progress", told(self.progress))

    def with_changes(self, changes: Mapping[str, Any]) -> Self:
        """The same with some of them changed: `changes` by name.

        Raises
        ------
        InputError
            Where there is no such option; the message names the nearest one.
        """
        known = [each.name for each in fields(self)]
        for name in changes:
            if name not in known:
                raise InputError(f"there is no option {name!r}{nearest_or_all(name, known)}")
        return replace(self, **changes)

    def report(self, share: float, word: str) -> None:
        """Tell whoever waits that a `share` (0 to 1) is done, and a `word` about it."""
        if callable(self.progress):
            self.progress(share, word)

    def within(self, begin: float, end: float) -> Self:
        """The same for one stage, whose progress goes from `begin` to `end` of the whole."""
        whole = self.report
        return replace(
            self, progress=lambda share, word: whole(begin + (end - begin) * share, word)
        )


def options_from(options: Options | None, changes: Mapping[str, Any]) -> Options:
    """The options that a caller gave, as one thing and by name.

    Raises
    ------
    InputError
        Where one of them cannot be.
    """
    if options is not None:
        instance("options", options, Options, "single options by name, as in delay_s=1e-4")
    return (options or Options()).with_changes(changes)


def _names() -> dict[str, Any]:
    """What the annotations mean, of priors too: they load NumPy."""
    from bayeshaptic.models.prior import Prior

    return globals() | {"Prior": Prior}
