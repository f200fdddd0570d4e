"""Training the models for closed doors."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from layoutexplore.cli import app
from layoutexplore.closed_doors import predict_closed_rooms
from layoutexplore.closed_doors.features import FEATURES
from layoutexplore.evaluation.closed_doors import score_prediction
from layoutexplore.files import write_arrays
from layoutexplore.grids.grid import FREE, OccupancyGrid
from layoutexplore.maps.buildings import building_of
from layoutexplore.maps.geojson import save_plan
from layoutexplore.maps.library import load_plan
from layoutexplore.models.forest_files import load_forests
from layoutexplore.training import closed_doors as training
from layoutexplore.training.closed_doors import collect, find_sources, fit, samples_of, save
from tests.closed_doors.cases import office


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


def test_samples_are_kept(closed_door_maps: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    sources = find_sources(closed_door_maps, [])
    assert [s.name for s in sources[:2]] == ["office_2_doors", "office-shut-0"]
    first = samples_of(sources[0], tmp_path / "cache")
    again = samples_of(sources[0], tmp_path / "cache")
    assert first is not None and again is not None and np.array_equal(first.boxes, again.boxes)
    (kept,) = (tmp_path / "cache").iterdir()
    assert kept.name.startswith("office_2_doors-") and kept.suffix == ".npz"
    monkeypatch.setattr(training, "package_fingerprint", lambda: "of other code")
    samples_of(sources[0], tmp_path / "cache")
    assert len(list((tmp_path / "cache").iterdir())) == 2, "other code may find other samples"
    assert {building_of(name, "closed doors") for name in ("battle_2", "battle_1", "battle2")} == {"battle"}


def test_kept_samples_that_do_not_fit_each_other_are_made_anew(
    closed_door_maps: Path, tmp_path: Path
) -> None:
    source = find_sources(closed_door_maps, [])[0]
    first = samples_of(source, tmp_path / "cache")
    assert first is not None and len(first.weight)
    (kept,) = (tmp_path / "cache").iterdir()
    write_arrays(kept, {**vars(first), "weight": first.weight[:-1]})
    with pytest.warns(UserWarning, match="made anew"):
        again = samples_of(source, tmp_path / "cache")
    assert again is not None and np.array_equal(again.weight, first.weight)


def test_samples_of_plans_of_one_name_are_told_apart(tmp_path: Path) -> None:
    """A floor of two buildings, and a plan that was edited meanwhile."""
    paths = [tmp_path / name / "floor.geojson" for name in ("east", "west")]
    for path, name in zip(paths, ("apartment-01", "apartment-02"), strict=True):
        path.parent.mkdir()
        save_plan(load_plan(name), path)
    sources = find_sources(None, [str(path) for path in paths])[:2]
    east, west = (samples_of(source, tmp_path / "cache") for source in sources)
    assert east is not None and west is not None and not np.array_equal(east.edges, west.edges)
    save_plan(load_plan("apartment-02"), paths[0])
    edited = samples_of(sources[0], tmp_path / "cache")
    assert edited is not None and np.array_equal(edited.edges, west.edges)


def test_a_plan_may_be_named_as_maps_of_a_folder_are(tmp_path: Path) -> None:
    save_plan(load_plan("apartment-01"), tmp_path / "hall-shut-2.geojson")
    (source, *_) = find_sources(None, [str(tmp_path / "hall-shut-2.geojson")])
    assert source.name == "hall-shut-2-plan-0" and samples_of(source) is not None


def test_floors_of_one_file_are_of_one_building_and_have_names_of_their_own() -> None:
    sources = find_sources(None, ["a/two towers.osm#0", "a/two towers.osm#1", "b/Villa_2.xml"])
    assert len({s.name for s in sources}) == len(sources)
    assert {s.building for s in sources} == {"two_towers", "Villa"}


def test_command_holds_buildings_out(
    closed_door_maps: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(training, "SHUT_AGAIN", 1)
    for path in list(closed_door_maps.glob("office_*")):
        if "OUT" not in path.name:
            (closed_door_maps / path.name.replace("office", "school")).write_bytes(path.read_bytes())
    arguments = [
        "evaluate",
        "closed-doors",
        str(closed_door_maps),
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
