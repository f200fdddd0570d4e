"""One rule for the same building, one for dealing folds."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from layoutexplore.evaluation.segmentation import MapScore, seed_spread
from layoutexplore.maps.buildings import group_buildings
from layoutexplore.maps.tracing import floorplan_from_ascii
from layoutexplore.training.folds import deal_folds
from tests.plans import THREE_OFFICES


def test_folds_and_seeds() -> None:
    assert set(deal_folds("aabbc", 2).values()) == {0, 1}
    zero: dict[str, Any] = dict.fromkeys(("precision", "recall", "iou_s", "iou_g", "a_fc", "a_bc", "ms"), 0.0)
    rows = [
        MapScore(
            folder="f",
            map="m",
            building="a",
            method="default",
            one_to_one=v,
            segments=1,
            rooms=1,
            seed=s,
            **zero,
        )
        for s, v in ((0, 0.4), (0, 0.6), (1, 0.7))
    ]
    (line,) = seed_spread(rows)
    assert line["seeds"] == 2 and line["one_to_one"] == pytest.approx(np.std([0.5, 0.7], ddof=1))


def test_floors_of_one_building() -> None:
    long = THREE_OFFICES.replace("#", "####")
    plans = [
        dataclasses.replace(floorplan_from_ascii(text, resolution=2.0, name=name), building=building)
        for text, name, building in ((THREE_OFFICES, "a1", "a"), (long, "a2", "a"), (long, "b", "b"))
    ]
    assert group_buildings(plans[:2]) == {"a1": "a1", "a2": "a1"}
    assert group_buildings(plans) == {"a1": "a1", "a2": "a1", "b": "a1"}  # The same outline.
