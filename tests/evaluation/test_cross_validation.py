"""Judges that are cross-validated never learn from what they are scored on."""

from __future__ import annotations

from pathlib import Path

import pytest

from layoutexplore.evaluation.cross_validation import CrossValidationConfig, cross_validate_merging
from layoutexplore.maps.painted_rooms import find_cases
from tests.evaluation.cases import LearntFrom, watch_merging_trainings
from tests.maps.test_painted_rooms import paint


def told(learnt: LearntFrom) -> tuple[set[str], set[str]]:
    """The buildings of the recorded maps, and the plans of the simulated ones."""
    return {e.building for e in learnt.recorded}, {e.kind for pair in learnt.simulated for e in pair}


def test_simulated_maps_of_a_building_that_is_held_out_are_not_learnt_from(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    learnt = watch_merging_trainings(monkeypatch)
    for k, name in enumerate(("flat", "barn")):
        paint(tmp_path, name, 40 + 4 * k)
    cases = find_cases([tmp_path], {"flat": "apartment-01"})
    config = CrossValidationConfig(
        folds=2, protocol="rose2", resolution=0.05, simulated=2, plans=("apartment-01",)
    )
    scored = {case.building: row.fold for case, row, _ in cross_validate_merging(cases, config)}
    assert set(scored) == {"apartment-01", "barn"}
    recorded, simulated = told(learnt[scored["apartment-01"]])
    assert recorded == {"barn"} and simulated and "apartment-01" not in simulated
    recorded, simulated = told(learnt[scored["barn"]])
    assert recorded == {"apartment-01"} and "apartment-01" in simulated
