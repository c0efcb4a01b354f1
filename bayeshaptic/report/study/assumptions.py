"""Everything that a reader must believe in order to believe the report of a study."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from bayeshaptic.study.analysis import StudyAnalysis


def assumptions(study: StudyAnalysis) -> tuple[str, ...]:
    """The assumptions that the recordings' own pages do not have, in sentences."""
    found = [
        "Everything that the recordings' own pages list: a pure stiffness, the loop's period, hold "
        "and delay, a device that is linear at the amplitudes that matter.",
        "The limit of the device is the lowest critical stiffness over all cases. Configurations "
        "along a coordinate are drawn together. Other cases are taken as independent, although "
        "they share the device's parameters; that errs on the safe side.",
    ]
    if study.population is not None:
        found += [
            "The logarithms of a hand's parameters (mh, bh, kh, bs, ks) are normal over people. "
            "The recordings and a weak prior decide their mean and covariance. The people who were "
            "recorded are a random choice of those who will use the device.",
            "The device itself is the same in every hand, up to a small spread between recordings "
            "that is inferred.",
        ]
    if study.configurations:
        found.append(
            "Between the configurations that were measured, the device's parameters change "
            "smoothly, with a scatter that is inferred. Beyond them nothing is said."
        )
    if study.study.references:
        found.append(
            "Limits known from elsewhere are drawn to compare with. No number is made from them."
        )
    return tuple(found)
