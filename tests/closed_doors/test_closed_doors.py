from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray
from typer.testing import CliRunner

from layoutexplore.cli import app
from layoutexplore.closed_doors import predict_closed_rooms
from layoutexplore.closed_doors.candidates import rectangles
from layoutexplore.closed_doors.doors import DOOR_FEATURES, door_features, find_edges
from layoutexplore.closed_doors.features import FEATURES, describe
from layoutexplore.closed_doors.models import shipped_models
from layoutexplore.closed_doors.prediction import door_probability, find_doors, turned_scenes
from layoutexplore.closed_doors.scene import room_space, wall_thickness
from layoutexplore.closed_doors.symmetry import best_mirror
from layoutexplore.errors import MapError
from layoutexplore.evaluation.closed_doors import evaluate, score_prediction, summarise
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from layoutexplore.maps.closed_door_maps import find_triples, read_cells
from layoutexplore.maps.tracing import floorplan_from_ascii
from layoutexplore.models.forest_files import load_forests
from layoutexplore.training import closed_doors as training
from layoutexplore.training.closed_doors import collect, find_sources, fit, samples_of, save
from layoutexplore.training.folds import building_of
from layoutexplore.training.shut_rooms import add_outer_doors, find_doorways, plan_cells, shut_rooms

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


def draw(cells: NDArray[np.int8], path: Path) -> None:
    cv2.imwrite(str(path), np.where(cells == FREE, 254, np.where(cells == OCCUPIED, 0, 205)).astype(np.uint8))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for k, shut in ((1, (2,)), (2, (2, 3))):
        seen, truth = office(shut)
        draw(seen, tmp_path / f"office_{k}_doors_IN.png")
        draw(truth, tmp_path / "office_GT.png")
    draw(truth, tmp_path / "office_1_doors_OUT.png")
    return tmp_path


def test_closed_doors_are_found_and_open_ones_are_not() -> None:
    def doors(shut: tuple[int, ...]) -> list[tuple[int, int]]:
        models = shipped_models()
        found = find_doors(
            office(shut)[0], 0.05, lambda turns, edges, features: door_probability(features, models)
        )
        assert not any(found[1:])
        return [(door.start, door.stop) for door in found[0]]

    assert doors((1, 4)) == [(10 + k * (WIDTH + WALL) + 25, 10 + k * (WIDTH + WALL) + 45) for k in (1, 4)]
    assert doors(()) == []


@given(arrays(np.int8, (9, 40), elements=st.sampled_from([FREE, FREE, FREE, UNKNOWN, OCCUPIED])))
def test_edges_by_a_slow_search(cells: NDArray[np.int8]) -> None:
    cells[:3], cells[3, 5:30] = UNKNOWN, OCCUPIED
    cells[4, 5:30] = FREE
    slow = []
    for row in range(1, 8):
        edge = [
            cells[row + 1, c] == FREE and cells[row, c] != FREE and cells[row - 1, c] == UNKNOWN
            for c in range(40)
        ]
        for start in range(40):
            if edge[start] and (start == 0 or not edge[start - 1]):
                stop = next((c for c in range(start, 40) if not edge[c]), 40)
                slow += [(row, start, stop)] if stop - start >= 12 else []
    assert [tuple(edge) for edge in find_edges(cells, 0.05).tolist()] == slow


def test_an_edge_in_numbers() -> None:
    seen, _ = office((2,))
    edges = find_edges(seen, 0.05)
    left = 10 + 2 * (WIDTH + WALL)
    (leaf,) = (k for k, edge in enumerate(edges.tolist()) if edge[1:] == [left + 25, left + 45])
    known = dict(zip(DOOR_FEATURES, door_features(seen, 0.05, edges)[leaf].tolist(), strict=True))
    assert (
        known["length"] == pytest.approx(1.0)
        and known["occupied"] == 1
        and known["behind"] == pytest.approx(3.0)
    )
    assert known["recess"] == known["recess_other"] == pytest.approx(0.15)
    assert known["loose"] == known["loose_other"] == 0


def test_walls_keep_their_thickness() -> None:
    seen, _ = office((2,))
    assert wall_thickness(seen, 0.05) == WALL
    space = room_space(seen, 3)
    slow = np.zeros_like(space)
    for row, col in np.argwhere(seen == UNKNOWN):
        slow[row, col] = (seen[max(row - 2, 0) : row + 3, max(col - 2, 0) : col + 3] == UNKNOWN).all()
    assert np.array_equal(space, slow)


def test_one_of_the_rectangles_is_the_room() -> None:
    seen, _ = office((2,))
    doors = find_doors(
        seen, 0.05, lambda turns, edges, features: (features[:, 7] > 0.1) * (features[:, 0] < 2.0) * 1.0
    )
    (door,) = doors[0]
    scene = next(iter(turned_scenes(seen, 0.05, doors)))
    boxes = rectangles(scene, door)
    room = np.array([10, 10 + 2 * (WIDTH + WALL), 10 + DEPTH, 10 + 2 * (WIDTH + WALL) + WIDTH])
    near = np.abs(boxes - room).max(1)
    assert near.min() <= 2
    known = dict(zip(FEATURES, describe(scene, door, boxes)[near.argmin()].tolist(), strict=True))
    assert (
        known["left_contact"] > 0.9
        and known["right_contact"] > 0.9
        and known["near_contact"] > 0.9
        and known["hull"] == 1
    )
    assert known["width"] == pytest.approx(WIDTH * 0.05, abs=0.15) and known["depth"] == pytest.approx(
        DEPTH * 0.05, abs=0.15
    )


@pytest.mark.parametrize("axis", [0, 1])
def test_the_mirror_image_of_a_symmetric_plan_completes_it(axis: int) -> None:
    seen, truth = office((1,)) if axis else (np.ascontiguousarray(cells.T) for cells in office((1,)))
    half = np.concatenate([seen, np.flip(seen, axis)], axis)
    whole = np.concatenate([truth, np.flip(truth, axis)], axis)
    half[tuple(slice(seen.shape[axis], None) if k == axis else slice(None) for k in (0, 1))] = np.flip(
        truth, axis
    )
    mirror = best_mirror(half)
    hidden = (whole == FREE) & (half != FREE)
    assert hidden.any() and (mirror.cells[hidden] == FREE).mean() > 0.98
    assert mirror.score > 0.3 and mirror.overlap > 0.9


@pytest.mark.parametrize("seed", range(4))
def test_rooms_shut_at_random_are_hidden_and_nothing_else(seed: int) -> None:
    _, truth = office(())
    assert len(find_doorways(truth, 0.05)) == 6
    rng = np.random.default_rng(seed)
    seen = shut_rooms(truth, 0.05, rng)
    assert seen is not None
    hidden = (truth == FREE) & (seen != FREE)
    assert not ((seen == FREE) & (truth != FREE)).any()
    assert hidden[:110].sum() >= 80 * 85 and not hidden[115:].any()
    parts, _ = cv2.connectedComponents((seen == FREE).astype(np.uint8), connectivity=4)
    assert parts == 2
    more, true = add_outer_doors(seen, truth, 0.05, rng, 4)
    assert ((true == FREE) & (more != FREE)).sum() > hidden.sum() - 200 and more.shape == seen.shape


def test_a_map_without_doorways_shuts_nothing() -> None:
    cells = _with_walls(np.pad(np.ones((60, 60), bool), 8))
    assert shut_rooms(cells, 0.05, np.random.default_rng(0)) is None


def test_a_floor_plan_becomes_a_map() -> None:
    plan = floorplan_from_ascii("#######\n#aa.bb#\n#aa#bb#\n#######", resolution=1.0)
    cells = plan_cells(plan, np.random.default_rng(0))
    assert set(np.unique(cells)) == {FREE, OCCUPIED, UNKNOWN} and (
        cells == FREE
    ).sum() * 0.05**2 == pytest.approx(9, rel=0.25)


def test_learning_from_maps(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    samples = [collect(*office(shut), 0.05, rng) for shut in ((2,), (1, 4), (0, 3, 5))]
    assert [int(s.is_door.sum()) for s in samples] == [1, 2, 3]
    assert all(
        s.boxes.shape == (len(s.agreement), len(FEATURES)) and s.agreement.max() > 0.9 for s in samples
    )
    models = fit(samples, trees=60)
    seen, truth = office((3,))
    predicted = predict_closed_rooms(OccupancyGrid(seen, 0.05), models)
    assert score_prediction(predicted.grid.free, seen == FREE, truth == FREE).iou > 0.9
    save(models, tmp_path / "models", "a note")
    again = load_forests(tmp_path / "models" / "rooms.json", FEATURES)["agreement"]
    boxes = samples[0].boxes
    assert np.allclose(again.score(boxes), models.rooms.score(boxes), atol=1e-3)


def test_samples_are_kept(folder: Path, tmp_path: Path) -> None:
    sources = find_sources(folder, [])
    assert [s.name for s in sources[:2]] == ["office_2_doors", "office-shut-0"]
    first = samples_of(sources[0], tmp_path / "cache")
    again = samples_of(sources[0], tmp_path / "cache")
    assert first is not None and again is not None and np.array_equal(first.boxes, again.boxes)
    assert [p.name for p in (tmp_path / "cache").iterdir()] == ["office_2_doors.npz"]
    assert building_of("battle_2") == building_of("battle_1") == building_of("battle2") == "battle"


def test_command_holds_buildings_out(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(training, "SHUT_AGAIN", 1)
    for path in list(folder.glob("office_*")):
        if "OUT" not in path.name:
            (folder / path.name.replace("office", "school")).write_bytes(path.read_bytes())
    arguments = [
        "evaluate",
        "closed-doors",
        str(folder),
        "--out",
        str(tmp_path / "out"),
        "--no-report",
        "--folds",
        "2",
    ]
    result = CliRunner().invoke(app, [*arguments, "--cache", str(tmp_path / "cache")])
    assert result.exit_code == 0, result.output
    assert "every building was held out" in result.output and result.output.count("never seen") == 4
    assert len(list((tmp_path / "cache").iterdir())) == 4


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
    nothing = score_prediction(seen, seen, truth)
    assert np.isnan(nothing.precision) and (nothing.iou, nothing.recall) == (0, 0)


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
    arguments = [
        "evaluate",
        "closed-doors",
        str(folder),
        "--out",
        str(out),
        "--json",
        str(report),
        "--no-report",
    ]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    assert {p.name for p in out.iterdir()} == {
        "office_1_doors_pred.png",
        "office_2_doors_pred.png",
        "best.png",
        "worst.png",
    }
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
    triples = [
        t for t in find_triples(data_dir / "closed_doors") if t.building == "Lamuniere1" and t.doors == 1
    ]
    (score,) = evaluate(triples, resolution=0.05)
    assert score.reference is not None
    assert score.reference.iou == pytest.approx(0.830, abs=0.001)
    assert score.reference.free_iou == pytest.approx(0.972, abs=0.001)
