from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from typer.testing import CliRunner

from layoutexplore.cli import app
from layoutexplore.closed_doors import predict_closed_rooms
from layoutexplore.closed_doors.candidates import room_space, wall_thickness
from layoutexplore.closed_doors.doors import find_doors
from layoutexplore.errors import MapError
from layoutexplore.evaluation.closed_doors import evaluate, find_triples, read_cells, score_prediction, summarise
from layoutexplore.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid

WALL, WIDTH, DEPTH = 6, 80, 90  # cells


def office(shut: tuple[int, ...], rooms: int = 6) -> tuple[NDArray[np.int8], NDArray[np.int8]]:
    """What is seen and the truth, int8 (rows, cols) from the top: a corridor with a row of rooms above it, some of them shut."""
    cols = 20 + rooms * (WIDTH + WALL)
    free = np.zeros((DEPTH + WALL + 90, cols), bool)
    corridor = slice(10 + DEPTH + WALL, 10 + DEPTH + WALL + 50)
    free[corridor, 10 : cols - 10 - WALL] = True
    seen = free.copy()
    for k in range(rooms):
        left = 10 + k * (WIDTH + WALL)
        room = np.s_[10 : 10 + DEPTH, left : left + WIDTH]
        door = np.s_[10 + DEPTH : 10 + DEPTH + WALL, left + 25 : left + 45]
        free[room] = free[door] = True
        if k in shut:
            seen[13 + DEPTH : 10 + DEPTH + WALL, left + 25 : left + 45] = True
        else:
            seen[room] = seen[door] = True
    return _with_walls(seen), _with_walls(free)


def _with_walls(free: NDArray[np.bool_]) -> NDArray[np.int8]:
    rim = cv2.dilate(free.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    return np.where(free, FREE, np.where(rim, OCCUPIED, UNKNOWN)).astype(np.int8)


def save(cells: NDArray[np.int8], path: Path) -> None:
    cv2.imwrite(str(path), np.where(cells == FREE, 254, np.where(cells == OCCUPIED, 0, 205)).astype(np.uint8))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for k, shut in ((1, (2,)), (2, (2, 3))):
        seen, truth = office(shut)
        save(seen, tmp_path / f"office_{k}_doors_IN.png")
        save(truth, tmp_path / "office_GT.png")
    save(truth, tmp_path / "office_1_doors_OUT.png")
    return tmp_path


def test_closed_doors_are_found_and_open_ones_are_not() -> None:
    seen, _ = office((1, 4))
    found = [d for d in find_doors(seen, 0.05) if d.recess >= 2]
    assert [(d.start, d.stop) for d in found] == [(10 + k * (WIDTH + WALL) + 25, 10 + k * (WIDTH + WALL) + 45) for k in (1, 4)]
    assert not [d for d in find_doors(office(())[0], 0.05) if d.recess >= 2]


def test_walls_keep_their_thickness() -> None:
    seen, _ = office((2,))
    assert wall_thickness(seen, 0.05) == WALL
    space = room_space(seen, 3)
    slow = np.zeros_like(space)
    for row, col in np.argwhere(seen == UNKNOWN):
        slow[row, col] = (seen[max(row - 2, 0) : row + 3, max(col - 2, 0) : col + 3] == UNKNOWN).all()
    assert np.array_equal(space, slow)


@pytest.mark.parametrize("turns", range(4))
def test_a_shut_room_between_its_neighbours_is_predicted(turns: int) -> None:
    seen, truth = (np.ascontiguousarray(np.rot90(cells, turns)) for cells in office((2,)))
    predicted = predict_closed_rooms(OccupancyGrid(seen, 0.05))
    score = score_prediction(predicted.grid.free, seen == FREE, truth == FREE)
    assert score.iou > 0.8
    assert np.array_equal(predicted.grid.cells[seen != UNKNOWN], seen[seen != UNKNOWN])


def test_a_grid_without_anything_known_stays_as_it_is() -> None:
    predicted = predict_closed_rooms(OccupancyGrid(np.full((50, 60), UNKNOWN, np.int8), 0.05))
    assert predicted.doors == 0 and not predicted.rooms.any()


def test_scores_by_hand() -> None:
    seen, truth = np.zeros((1, 10), bool), np.zeros((1, 10), bool)
    seen[0, :4] = truth[0, :8] = True
    predicted = seen.copy()
    predicted[0, 6:10] = True
    score = score_prediction(predicted, seen, truth)
    assert (score.free_iou, score.iou, score.precision, score.recall) == (0.6, 2 / 6, 0.5, 0.5)
    assert score_prediction(truth, seen, truth).iou == 1


def test_evaluation_writes_predictions_in_the_same_frame(folder: Path, tmp_path: Path) -> None:
    scores = list(evaluate(find_triples(folder), resolution=0.05, out=tmp_path / "out"))
    assert [s.doors for s in scores] == [1, 2]
    assert scores[0].reference is not None and scores[0].reference.iou == 1 and scores[1].reference is None
    pixels = cv2.imread(str(tmp_path / "out" / "office_1_doors_pred.png"), cv2.IMREAD_UNCHANGED)
    assert pixels.shape == read_cells(folder / "office_1_doors_IN.png").shape
    assert set(np.unique(pixels)) == {0, 205, 254}
    assert [line["maps"] for line in summarise(scores)] == [1, 1, 1, 1, 2]


def test_command(folder: Path, tmp_path: Path) -> None:
    out, report = tmp_path / "out", tmp_path / "numbers.json"
    arguments = ["evaluate", "closed-doors", str(folder), "--out", str(out), "--json", str(report)]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    assert {p.name for p in out.iterdir()} == {"office_1_doors_pred.png", "office_2_doors_pred.png", "best.png", "worst.png"}
    assert len(json.loads(report.read_text())["maps"]) == 2


def test_broken_or_missing_files_are_named(folder: Path) -> None:
    with pytest.raises(MapError, match="no such folder"):
        find_triples(folder / "nowhere")
    (folder / "office_3_doors_IN.png").write_bytes(b"no image")
    with pytest.raises(MapError, match=r"office_3_doors_IN.png: not an image"):
        list(evaluate(find_triples(folder), resolution=0.05))
    grey = np.full((20, 20), 100, np.uint8)
    cv2.imwrite(str(folder / "office_3_doors_IN.png"), grey)
    with pytest.raises(MapError, match="grey level 100"):
        read_cells(folder / "office_3_doors_IN.png")
    with pytest.raises(MapError, match="20 x 20 pixels"):
        read_cells(folder / "office_3_doors_IN.png", (5, 5))
    (folder / "office_GT.png").unlink()
    with pytest.raises(MapError, match=r"office_GT.png is missing"):
        find_triples(folder)


def test_definitions_on_a_published_answer(data_dir: Path) -> None:
    if not (data_dir / "closed_doors").is_dir():
        pytest.skip("no closed_doors in the data folder")
    triples = [t for t in find_triples(data_dir / "closed_doors") if t.building == "Lamuniere1" and t.doors == 1]
    (score,) = evaluate(triples, resolution=0.05)
    assert score.reference is not None
    assert score.reference.iou == pytest.approx(0.830, abs=0.001)
    assert score.reference.free_iou == pytest.approx(0.972, abs=0.001)
