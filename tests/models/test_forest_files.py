"""Files of trees: what ships, what is damaged, what cannot be written."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from layoutexplore.closed_doors.models import DOOR_MODEL, ROOM_MODEL
from layoutexplore.errors import ConfigError, MapError
from layoutexplore.layout.merging.merge_forest import PAIR_FOREST
from layoutexplore.layout.merging.merge_tree.cut import CUT_FOREST
from layoutexplore.layout.merging.ray_fans.classifier import FAN_FOREST
from layoutexplore.models.forest import Forest
from layoutexplore.models.forest_files import load_forests, save_forests
from layoutexplore.predictors.learned import CELL_MODEL, FRONTIER_MODEL


def same(one: Forest, other: Forest) -> bool:
    columns = ("feature", "threshold", "left", "right", "roots")
    pairs = [(getattr(one, column), getattr(other, column)) for column in columns]
    return one.bias == other.bias and all(a.dtype == b.dtype and np.array_equal(a, b) for a, b in pairs)


DOUBLE = [kind.shipped for kind in (PAIR_FOREST, CUT_FOREST, FAN_FOREST)]
SINGLE = [FRONTIER_MODEL, CELL_MODEL, DOOR_MODEL, ROOM_MODEL]


@pytest.mark.parametrize("path", [*DOUBLE, *SINGLE], ids=lambda path: path.stem)
def test_what_ships_is_written_again_to_the_last_byte(path: Path, tmp_path: Path) -> None:
    data = json.loads(path.read_text())
    features, double = tuple(data["features"]), path in DOUBLE
    forests = load_forests(path, features, double=double)
    save_forests(tmp_path / "again.json", forests, features, data["note"], double=double)
    assert (tmp_path / "again.json").read_bytes() == path.read_bytes()


@settings(max_examples=40, deadline=None)
@given(st.lists(st.floats(-1e6, 1e6), min_size=6, max_size=6), st.floats(-10, 10))
def test_all_digits_are_kept_or_those_of_float32(
    tmp_path_factory: pytest.TempPathFactory, numbers: list[float], bias: float
) -> None:
    column = [
        np.array(values, np.int32)
        for values in ([0, -1, -1, 1, -1, -1], [1, 0, 0, 4, 0, 0], [2, 0, 0, 5, 0, 0], [0, 3])
    ]
    forest = Forest(column[0], np.array(numbers), column[1], column[2], column[3], bias)
    path = tmp_path_factory.mktemp("model") / "model.json"
    save_forests(path, {"x": forest}, ("a", "b"), double=True)
    assert same(load_forests(path, ("a", "b"), double=True)["x"], forest)
    forest = replace(forest, threshold=forest.threshold.astype(np.float32).astype(np.float64))
    save_forests(path.with_name("single.json"), {"x": forest}, ("a", "b"))
    single = load_forests(path.with_name("single.json"), ("a", "b"))["x"].threshold
    leaf = column[0] < 0
    assert np.array_equal(single[~leaf], forest.threshold[~leaf])
    assert np.allclose(single[leaf], forest.threshold[leaf], rtol=1e-4, atol=1e-30)


@pytest.mark.parametrize(
    "text",
    [
        "not json",
        "[]",
        '{"features": ["a"]}',
        '{"features": ["a"], "forests": {"x": {"bias": 0, "trees": [[]]}}}',
        '{"features": ["a"], "forests": {"x": {"bias": 0, "trees": [[[0, 1.0, 0, 1], [1.0]]]}}}',
        '{"features": ["a"], "forests": {"x": {"bias": 0, "trees": [[[1, 1.0, 1, 2], [1.0], [1.0]]]}}}',
        '{"features": ["a"], "forests": {"x": {"bias": 0, "trees": [[[0, "high", 1, 2], [1.0], [1.0]]]}}}',
        '{"features": ["a"], "forests": {"x": {"bias": 0, "trees": [[[null]]]}}}',
        '{"features": ["a"], "forests": {"x": {"bias": 1e300, "trees": [[[1.0]]]}}}',
        '{"features": ["a"], "forests": {"x": {"bias": 0, "trees": [[[0, 1.0, 1, 2], [1e30], [1.0]]]}}}',
    ],
)
def test_foreign_and_damaged_models(text: str, tmp_path: Path) -> None:
    path = tmp_path / "model.json"
    path.write_text(text)
    with pytest.raises(ConfigError, match=r"model\.json"):
        load_forests(path, ("a",))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("]]\n]}\n}}\n", "", "broken JSON"),
        ("one_room", "two_rooms", "'one_room' is missing"),
        ("log_area_small", "log_area_tiny", "train it again"),
        (",1,10],", ",0,10],", "damaged trees .node 0 of tree"),
    ],
)
def test_a_damaged_judge_is_named(old: str, new: str, message: str, tmp_path: Path) -> None:
    text = PAIR_FOREST.shipped.read_text()
    assert old in text
    path = tmp_path / "judge.json"
    path.write_text(text.replace(old, new))
    with pytest.raises(ConfigError, match=message) as caught:
        PAIR_FOREST.load(path)
    assert "judge.json" in str(caught.value)


def test_no_model_there(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"judge\.json: no model can be read here"):
        PAIR_FOREST.load(tmp_path / "judge.json")


def test_a_model_that_cannot_be_written_leaves_nothing_behind(tmp_path: Path) -> None:
    (tmp_path / "model.json").mkdir()
    with pytest.raises(MapError, match=r"model\.json: cannot write"):
        save_forests(tmp_path / "model.json", {}, ())
    assert [path.name for path in tmp_path.iterdir()] == ["model.json"]
