"""The sentences of a study's page."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from fake_study import fake_study

from bayeshaptic.report.study.words import people


def test_people_hardly_move_the_limit_only_where_rare_ones_do_not_either() -> None:
    """Three users were said not to matter, where one in a thousand had half of the limit."""
    alike = fake_study(people=2, device="lhifam", spread=0.002)
    case = alike.new_person[0]
    assert "More people would not narrow it" in " ".join(people(alike))
    samples = np.tile(case.limit.samples, 200)
    samples[::500] *= 0.5
    limit = replace(case.limit, samples=samples, chains=len(samples))
    words = " ".join(people(replace(alike, new_person=(replace(case, limit=limit),))))
    assert "People hardly move" in words and "does not matter" not in words
    assert "That does not hold of everybody: of one person in a thousand it is below" in words
