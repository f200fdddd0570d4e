"""Scores of predictions behind closed doors."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import cv2
import numpy as np
import pytest

from layoutexplore.errors import ConfigError, MapError
from layoutexplore.evaluation.closed_doors import (
    PairScore,
    Score,
    cross_validate_closed_doors,
    evaluate,
    held_out_groups,
    score_prediction,
    summarise_closed_doors,
)
from layoutexplore.maps.closed_door_maps import find_triples, read_cells


def test_scores_by_hand() -> None:
    seen, truth = np.zeros((1, 10), bool), np.zeros((1, 10), bool)
    seen[0, :4] = truth[0, :8] = True
    predicted = seen.copy()
    predicted[0, 6:10] = True
    score = score_prediction(predicted, seen, truth)
    assert (score.free_iou, score.iou, score.precision, score.recall) == (0.6, 2 / 6, 0.5, 0.5)
    assert score_prediction(truth, seen, truth).iou == 1
    nothing = score_prediction(seen, seen, truth)
    assert np.isnan(nothing.precision) and (nothing.iou, nothing.recall) == (0, 0)


def test_evaluation_writes_predictions_in_the_same_frame(closed_door_maps: Path, tmp_path: Path) -> None:
    scores = list(evaluate(find_triples(closed_door_maps), resolution=0.05, out=tmp_path / "out"))
    assert [s.doors for s in scores] == [1, 2]
    assert scores[0].reference is not None and scores[0].reference.iou == 1 and scores[1].reference is None
    pixels = cv2.imread(str(tmp_path / "out" / "office_1_doors_pred.png"), cv2.IMREAD_UNCHANGED)
    assert pixels.shape == read_cells(closed_door_maps / "office_1_doors_IN.png").shape
    assert set(np.unique(pixels)) == {0, 205, 254}
    assert [line["maps"] for line in summarise_closed_doors(scores)] == [1, 1, 1, 1, 2]


def test_broken_or_missing_files_are_named(closed_door_maps: Path) -> None:
    with pytest.raises(MapError, match="no such folder"):
        find_triples(closed_door_maps / "nowhere")
    (closed_door_maps / "office_3_doors_IN.png").write_bytes(b"no image")
    with pytest.raises(MapError, match=r"office_3_doors_IN.png: not an image"):
        list(evaluate(find_triples(closed_door_maps), resolution=0.05))
    grey = np.full((20, 20), 100, np.uint8)
    cv2.imwrite(str(closed_door_maps / "office_3_doors_IN.png"), grey)
    with pytest.raises(MapError, match="grey level 100"):
        read_cells(closed_door_maps / "office_3_doors_IN.png")
    with pytest.raises(MapError, match="20 x 20 pixels"):
        read_cells(closed_door_maps / "office_3_doors_IN.png", (5, 5))
    (closed_door_maps / "office_GT.png").unlink()
    with pytest.raises(MapError, match=r"office_GT.png is missing"):
        find_triples(closed_door_maps)


def test_buildings_are_held_out_in_two_groups_at_least_and_one_each_at_most(closed_door_maps: Path) -> None:
    one = find_triples(closed_door_maps)
    others = [dataclasses.replace(triple, building=name) for triple in one for name in ("barn", "mill_2")]
    assert held_out_groups([*one, *others], 8) == 3 and held_out_groups([*one, *others], 2) == 2
    for triples, folds in ((one, 8), ([*one, *others], 1)):
        with pytest.raises(ConfigError, match="two folds and two buildings"):
            held_out_groups(triples, folds)
    with pytest.raises(ConfigError, match="two folds and two buildings"):
        next(cross_validate_closed_doors(one, 8, [], resolution=0.05))
    with pytest.raises(MapError, match="nothing is left to learn from"):
        next(cross_validate_closed_doors(others, 2, [], resolution=0.05))


def test_definitions_on_a_published_answer(data_dir: Path) -> None:
    if not (data_dir / "closed_doors").is_dir():
        pytest.skip("no closed_doors in the data folder")
    triples = [
        t for t in find_triples(data_dir / "closed_doors") if t.building == "Lamuniere1" and t.doors == 1
    ]
    (score,) = evaluate(triples, resolution=0.05)
    assert score.reference is not None
    assert score.reference.iou == pytest.approx(0.830, abs=0.001)
    assert score.reference.free_iou == pytest.approx(0.972, abs=0.001)


def test_floors_of_one_building_are_one_in_the_intervals() -> None:
    scores = [
        PairScore(f"school_{1 + k // 3}", k, 10.0, 0.9, Score(0.9, iou, 0.9, 0.9), None, 1.0)
        for k, iou in enumerate((0.3, 0.4, 0.5, 0.7, 0.8, 0.9))
    ]
    (line,) = summarise_closed_doors(scores)
    assert np.isnan(line["iqm_low"]) and np.isnan(line["iqm_high"])
    others = [dataclasses.replace(score, building=f"{score.building}_west") for score in scores]
    digits = [dataclasses.replace(score, building=f"{k // 3}") for k, score in enumerate(scores)]
    for apart in (others, digits):
        (line,) = summarise_closed_doors(apart)
        assert line["iqm_low"] < line["iqm"] < line["iqm_high"]
