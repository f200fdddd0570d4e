"""The commands `layout` and `evaluate`, on small maps drawn here."""

from __future__ import annotations

import csv
import json
import os
from pathlib import Path

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from layoutexplore.cli import app
from layoutexplore.cli.evaluate.segmentation import weights_of
from layoutexplore.errors import ConfigError, MapError
from layoutexplore.grids.ros_map import encode_png
from layoutexplore.layout.merging.merge_forest import PAIR_FOREST
from layoutexplore.layout.merging.merge_tree.cut import CUT_FOREST, MergingModels
from layoutexplore.maps import expand_plans, load_plan
from layoutexplore.maps.buildings import building_of
from layoutexplore.maps.painted_rooms import find_cases
from layoutexplore.training.folds import check_folds, deal_folds
from layoutexplore.training.merging_examples import SIMULATED
from layoutexplore.training.room_merging import first_forest
from tests.evaluation.cases import watch_merging_trainings
from tests.maps.cases import share_reached

runner = CliRunner()


def draw(folder: Path, name: str, wall: int = 82) -> None:
    """Two rooms side by side, the wall between them at column `wall`, and their painted truth."""
    image = np.full((140, 200), 205, np.uint8)
    image[20:120, 20:180] = 0
    truth = np.zeros((140, 200, 3), np.uint8)
    for (left, right), colour in (((24, wall), (0, 0, 255)), ((wall + 4, 176), (0, 255, 0))):
        image[24:116, left:right] = 254
        truth[24:116, left:right] = colour
    image[60:78, wall : wall + 4] = 254
    cv2.imwrite(str(folder / f"{name}.png"), image)
    cv2.imwrite(str(folder / f"{name}_gt.png"), truth)


def test_layout_writes_labels_in_the_image_orientation(tmp_path: Path) -> None:
    draw(tmp_path, "flat")
    result = runner.invoke(
        app, ["layout", str(tmp_path / "flat.png"), "--out", str(tmp_path / "out"), "--json"]
    )
    assert result.exit_code == 0, result.output
    summary = json.loads(result.stdout)
    assert summary["rooms"] == 2
    labels = cv2.imread(summary["labels"], cv2.IMREAD_UNCHANGED)
    assert labels.dtype == np.uint16 and labels.shape == (140, 200)
    assert labels[30, 30] != labels[30, 150] and labels[0, 0] == 0
    image = cv2.imread(str(tmp_path / "flat.png"), cv2.IMREAD_GRAYSCALE)
    assert not labels[image == 0].any()
    features = json.loads(Path(summary["geojson"]).read_text())["features"]
    assert len(features) >= 2
    assert cv2.imread(summary["overview"]) is not None


@pytest.mark.parametrize("method", ["default", "rose2", "distance"])
def test_what_layout_writes_is_a_floor_plan(tmp_path: Path, method: str) -> None:
    draw(tmp_path, "flat")
    (tmp_path / "flat_gt.png").unlink()
    out = tmp_path / "out"
    result = runner.invoke(app, ["layout", str(tmp_path / "flat.png"), "--out", str(out), "-m", method])
    assert result.exit_code == 0, result.output
    assert expand_plans(out) == [str(out / "flat_layout.geojson")]
    for name in ("flat_layout.geojson", "flat_labels.png"):
        plan = load_plan(out / name)
        assert len(plan.rooms) == 2 and [door.rooms for door in plan.doors] == [(1, 2)], name
        assert plan.doors[0].width == pytest.approx(0.9, abs=0.11)
        assert share_reached(plan) > 0.95 and share_reached(plan.with_doors_closed([0])) < 0.7
        free = plan.rasterize(0.05).free.sum() * 0.05**2
        assert free == pytest.approx((58 * 92 + 90 * 92 + 4 * 18) * 0.05**2, rel=0.03)
    # Beside the map, its labels are its rooms.
    (out / "flat_labels.png").rename(tmp_path / "flat_labels.png")
    assert len(load_plan(tmp_path / "flat.png").rooms) == 2


def test_layout_prints_a_line_a_map_and_refuses_equal_names(tmp_path: Path) -> None:
    for name in ("a", "b"):
        draw(tmp_path, name)
    maps = [str(tmp_path / f"{n}.png") for n in ("a", "b")]
    result = runner.invoke(app, ["layout", *maps, "--out", str(tmp_path), "-m", "distance"])
    assert result.exit_code == 0 and len(result.output.strip().splitlines()) == 2
    assert result.output.count("0.05 m a pixel (assumed: the image has no scale)") == 2
    (tmp_path / "c").write_bytes((tmp_path / "a.png").read_bytes())  # whatever it is called
    result = runner.invoke(app, ["layout", str(tmp_path / "c"), "--out", str(tmp_path), "-m", "distance"])
    assert result.output.count("(assumed: the image has no scale)") == 1
    again = runner.invoke(app, ["layout", maps[0], maps[0], "--out", str(tmp_path)])
    assert isinstance(again.exception, ConfigError)
    # Its own results are made anew; room numbers that are somebody's own, or a map, are not written over.
    words = ["layout", maps[0], "--out", str(tmp_path), "-m", "distance"]
    assert runner.invoke(app, [*words, "--resolution", "0.1"]).output.count("0.1 m a pixel (as given)") == 1
    labels = tmp_path / "a_labels.png"
    (tmp_path / "a_gt.png").unlink()
    for case in ([*words, str(labels)], words):
        result = runner.invoke(app, case)
        assert isinstance(result.exception, ConfigError) and "a_labels.png is read" in str(result.exception)
        (tmp_path / "a_layout.geojson").unlink(missing_ok=True)


def test_results_of_maps_of_one_name_are_called_by_their_folders_too(tmp_path: Path) -> None:
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        draw(tmp_path / name, "map")
    maps = [str(tmp_path / name / "map.png") for name in ("one", "two")]
    result = runner.invoke(app, ["layout", *maps, "--out", str(tmp_path / "out"), "-m", "distance"])
    assert result.exit_code == 0, result.output
    names = {path.name for path in (tmp_path / "out").glob("*_labels.png")}
    assert names == {"one_map_labels.png", "two_map_labels.png"}


def test_a_map_of_any_length_is_written(tmp_path: Path) -> None:
    """Sides of 32,768 pixels and more were refused once the layout was found: "must be a picture, uint8"."""
    cv2.imwrite(str(tmp_path / "long.png"), np.full((12, 40_000), 254, np.uint8))
    words = ["layout", str(tmp_path / "long.png"), "--out", str(tmp_path), "-m", "distance"]
    assert runner.invoke(app, words).exit_code == 0
    assert cv2.imread(str(tmp_path / "long_labels.png"), cv2.IMREAD_UNCHANGED).shape == (12, 40_000)
    with pytest.raises(MapError, match="is a picture of 1000001 x 2 pixels, of which a side may have"):
        encode_png(np.zeros((2, 1_000_001), np.uint8))


def test_what_is_no_map_is_told_what_reads_it(tmp_path: Path) -> None:
    (tmp_path / "school.xml").write_text("<Floor/>")
    result = runner.invoke(app, ["layout", str(tmp_path / "school.xml"), "--out", str(tmp_path)])
    assert result.exit_code == 2 and "is a floor plan, no map or image: `layoutexplore maps" in result.stderr
    draw(tmp_path, "a")
    result = runner.invoke(app, ["layout", str(tmp_path / "a.png"), "--out", str(tmp_path / "k_labels.png")])
    assert isinstance(result.exception, ConfigError) and "must name a folder" in str(result.exception)


def test_a_broken_map_does_not_keep_the_others_from_being_done(tmp_path: Path) -> None:
    draw(tmp_path, "good")
    whole = (tmp_path / "good.png").read_bytes()
    (tmp_path / "cut.png").write_bytes(whole[: len(whole) // 2])
    (tmp_path / "text.png").write_text("no image")
    maps = [str(tmp_path / f"{name}.png") for name in ("cut", "good", "text", "missing")]
    result = runner.invoke(app, ["layout", *maps, "--out", str(tmp_path / "out"), "-m", "distance"])
    assert result.exit_code == 2
    errors = result.stderr.splitlines()
    assert [line.split(": ")[1] for line in errors] == [maps[0], maps[2], maps[3]]
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [
        "good_labels.png",
        "good_layout.geojson",
        "good_overview.png",
    ]


def test_places_that_cannot_be_written_are_found_before_the_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    draw(tmp_path, "a")
    file = tmp_path / "file"
    file.write_text("mine")
    commands = [
        ["layout", str(tmp_path / "a.png"), "--out", str(file)],
        ["layout", str(tmp_path / "a.png"), "--out", str(file / "deeper")],
        ["evaluate", "segmentation", str(tmp_path), "--out", str(file)],
        ["evaluate", "segmentation", str(tmp_path), "--json", str(tmp_path)],
        ["evaluate", "layout", str(tmp_path), "--json", str(file / "n.json")],
        ["evaluate", "clutter", str(tmp_path), "--json", str(tmp_path)],
    ]
    for command in commands:
        result = runner.invoke(app, command)
        assert isinstance(result.exception, ConfigError) and command[-2] in str(result.exception), command
        assert not result.output
    monkeypatch.setattr("os.access", lambda path, mode: not mode & os.W_OK)
    result = runner.invoke(
        app, ["layout", str(tmp_path / "a.png"), "--out", str(tmp_path / "new" / "folder")]
    )
    assert isinstance(result.exception, ConfigError) and "permission" in str(result.exception)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.png", "a_gt.png", "file"]


@pytest.mark.parametrize("resolution", ["-1", "0", "nan", "inf"])
@pytest.mark.parametrize("blueprint", [[], ["--blueprint"]])
def test_a_resolution_that_is_none_is_refused(tmp_path: Path, resolution: str, blueprint: list[str]) -> None:
    draw(tmp_path, "a")
    result = runner.invoke(app, ["layout", str(tmp_path / "a.png"), "--resolution", resolution, *blueprint])
    assert result.exit_code == 2 or isinstance(result.exception, MapError)


def test_evaluate_segmentation_scores_several_methods(tmp_path: Path) -> None:
    for k, name in enumerate(("a", "b")):
        draw(tmp_path, name, 82 + 10 * k)
    out = tmp_path / "report"
    numbers = tmp_path / "numbers.json"
    options = [
        "-m",
        "default",
        "-m",
        "voronoi",
        "--out",
        str(out),
        "--json",
        str(numbers),
        "--protocol",
        "bormann",
    ]
    result = runner.invoke(app, ["evaluate", "segmentation", str(tmp_path), *options])
    assert result.exit_code == 0, result.output
    data = json.loads(numbers.read_text())
    assert {r["method"] for r in data["maps"]} == {"default", "voronoi"} and len(data["maps"]) == 4
    best = next(line for line in data["summary"] if line["method"] == "default")
    assert best["one_to_one"] > 0.9 and best["maps"] == 2
    rows = list(csv.DictReader((out / "results.csv").open()))
    assert len(rows) == 4 and float(rows[0]["precision"]) > 90
    page = (out / "report.html").read_text()
    assert "Map by map" in page and page.count("<img") == 4 and "<b>2</b>maps" in page
    assert len(list((out / "pictures").glob("*.png"))) == 4


def test_cross_validation_never_trains_on_the_building_it_scores(tmp_path: Path) -> None:
    for k, name in enumerate(("tower_scan", "tower2", "barn")):
        draw(tmp_path, name, 82 + 4 * k)
    cases = find_cases([tmp_path])
    assert {c.building for c in cases} == {"tower", "tower2", "barn"}
    buildings = [case.building for case in cases]
    assert len(set(deal_folds(buildings, 3).values())) == 3
    with pytest.raises(ConfigError, match="folds"):
        check_folds(4, buildings)
    options = ["--folds", "2", "--simulated", "2", "--weight", f"{tmp_path.name}=2"]
    result = runner.invoke(app, ["evaluate", "segmentation", str(tmp_path), *options])
    assert result.exit_code == 0, result.output
    assert result.output.count("default:") == 3


def test_a_source_is_scored_without_its_maps_and_its_buildings(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn = {"survey": ("tower_scan", "barn"), "survey_full": ("tower",), "clutter": ("tower", "mill")}
    for k, (folder, names) in enumerate(drawn.items()):
        (tmp_path / folder).mkdir()
        for n, name in enumerate(names):
            draw(tmp_path / folder, name, 82 + 8 * k + 4 * n)
    trainings = watch_merging_trainings(monkeypatch)
    command = ["evaluate", "segmentation", *(str(tmp_path / folder) for folder in drawn)]
    options = ["--leave-out", "source", "--source", "survey_full=survey", "--simulated", "2"]
    numbers = tmp_path / "numbers.json"
    result = runner.invoke(app, [*command, *options, "--json", str(numbers)])
    assert result.exit_code == 0, result.output
    for one in trainings:
        assert not one.polygonal
        assert all(example.building == SIMULATED for pair in one.simulated for example in pair)
    learnt = [{(e.kind.split(",")[0], e.building) for e in one.recorded} for one in trainings]
    # the tower is of both sources, so that no map of it is trained on for either
    assert learnt == [{("clutter", "mill")}, {("survey", "barn")}]
    data = json.loads(numbers.read_text())
    assert [(line["source"], line["maps"], line["buildings"]) for line in data["source"]] == [
        ("survey", 3, 2),
        ("clutter", 2, 2),
    ]
    assert len(data["building"]) == 5 and {row["source"] for row in data["maps"]} == {"survey", "clutter"}
    assert "source left out" in result.output
    for wrong, said in (
        (["--leave-out", "source", "--source", "clutter"], "FOLDER=SOURCE"),
        (["--leave-out", "source", "--source", "nowhere=a"], "no folder of that name"),
        (["--leave-out", "source", "--folds", "2"], "choose one"),
        (["--leave-out", "source", "-m", "rose2"], "the only one that is trained"),
        (["--source", "clutter=a"], "needs"),
        (["--leave-out", "source", *(f"--source={folder}=one" for folder in drawn)], "at least two"),
    ):
        result = runner.invoke(app, [*command, *wrong])
        assert isinstance(result.exception, ConfigError) and said in str(result.exception), wrong


def test_buildings_come_from_a_file_or_the_name(tmp_path: Path) -> None:
    draw(tmp_path, "map1")
    assert building_of("lab_intel", "painted rooms") == building_of("intel_map", "painted rooms") == "intel"
    assert find_cases([tmp_path])[0].building == tmp_path.name
    assert find_cases([tmp_path], {"map1": "castle"})[0].building == "castle"


def test_what_is_missing_is_said_clearly(tmp_path: Path) -> None:
    with pytest.raises(MapError, match="no map"):
        find_cases([tmp_path])
    with pytest.raises(MapError, match="no such folder"):
        find_cases([tmp_path / "nowhere"])
    result = runner.invoke(app, ["evaluate", "segmentation", str(tmp_path), "--protocol", "roses"])
    assert isinstance(result.exception, ConfigError)
    result = runner.invoke(app, ["evaluate", "segmentation", str(tmp_path), "-m", "roses"])
    assert isinstance(result.exception, ConfigError)
    table = tmp_path / "buildings.csv"
    for text in ("", "hello\n", "name;house\nmap1;castle\n"):
        table.write_text(text)
        result = runner.invoke(app, ["evaluate", "segmentation", str(tmp_path), "--buildings", str(table)])
        assert isinstance(result.exception, ConfigError) and "columns map and building" in str(
            result.exception
        )
    for options in (["--seeds", "2"], ["--weight", "x=2"], ["--plans", "office-01"], ["--simulated", "9"]):
        draw(tmp_path, "map1")
        result = runner.invoke(app, ["evaluate", "segmentation", str(tmp_path), *options])
        assert isinstance(result.exception, ConfigError) and "--folds" in str(result.exception)
    for weight in ("nowhere=4", f"{tmp_path.name}=heavy", f"{tmp_path.name}=0"):
        draw(tmp_path, "map1")
        result = runner.invoke(
            app, ["evaluate", "train", str(tmp_path), "--out", str(tmp_path / "m.json"), "--weight", weight]
        )
        assert isinstance(result.exception, ConfigError) and weight in str(result.exception)


def test_weights_of_two_folders_of_one_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By as much of their path as tells them apart, or by the path."""
    for home in ("east", "west"):
        (tmp_path / home / "maps").mkdir(parents=True)
        draw(tmp_path / home / "maps", home)
    monkeypatch.chdir(tmp_path)
    cases = find_cases(["east/maps", "west/maps"])
    with pytest.raises(ConfigError, match="2 folders are called maps: say which, east/maps or west/maps"):
        weights_of(["maps=2"], cases)
    with pytest.raises(ConfigError, match="east/maps has a weight already"):
        weights_of(["east/maps=2", f"{tmp_path}/east/maps=3"], cases)
    assert weights_of(["east/maps=2", f"{tmp_path}/west/maps=3"], cases) == {"east/maps": 2, "west/maps": 3}
    assert weights_of(["west/maps/=2"], find_cases(["west/maps"])) == {"maps": 2}


@pytest.mark.slow
def test_one_command_trains_the_judge_of_pairs_and_that_of_merges(tmp_path: Path) -> None:
    for name in ("castle", "barn", "mill"):
        draw(tmp_path, name)
    command = [
        "evaluate",
        "train",
        str(tmp_path),
        "--simulated",
        "6",
        "--out",
        str(tmp_path / "new" / "m.json"),
    ]
    result = runner.invoke(app, command)
    assert result.exit_code == 0, result.output
    models = MergingModels(
        PAIR_FOREST.load(tmp_path / "new" / "m.json"), CUT_FOREST.load(tmp_path / "new" / "cut_model.json")
    )
    assert models.cut is not None and len(models.cut.roots) == 240 and len(models.pairs.roots) == 120
    result = runner.invoke(app, [*command, "--cut-out", str(tmp_path)])
    assert isinstance(result.exception, ConfigError) and "--cut-out" in str(result.exception)


def test_a_truth_without_a_painted_room_is_an_error_and_no_score_of_zero(tmp_path: Path) -> None:
    draw(tmp_path, "map1")
    cv2.imwrite(str(tmp_path / "map1_gt.png"), np.zeros((140, 200), np.uint8))
    result = runner.invoke(app, ["evaluate", "segmentation", str(tmp_path)])
    assert isinstance(result.exception, MapError) and "no room is painted" in str(result.exception)


def test_evaluate_layout_on_a_school(data_dir: Path, tmp_path: Path) -> None:
    folder = data_dir / "gridmaps" / "schools"
    for suffix in (".png", "_gt.xml"):
        (tmp_path / f"herndon{suffix}").write_bytes((folder / f"herndon{suffix}").read_bytes())
    result = runner.invoke(app, ["evaluate", "layout", str(tmp_path), "--json", str(tmp_path / "n.json")])
    assert result.exit_code == 0, result.output
    row = json.loads((tmp_path / "n.json").read_text())["maps"][0]
    assert row["a_fc"] > 0.75 and row["a_bc"] > 0.7 and not row["truth_mirrored"]


def test_evaluate_layout_mirrors_a_truth_whose_y_points_down(data_dir: Path, tmp_path: Path) -> None:
    plan = data_dir / "floorplans" / "schools" / "battle_creekhs_2.xml"
    (tmp_path / "school_gt.xml").write_bytes(plan.read_bytes())
    free = load_plan(plan).rasterize(0.1).free
    cv2.imwrite(str(tmp_path / "school.png"), np.where(free, 254, 0).astype(np.uint8)[::-1])
    result = runner.invoke(app, ["evaluate", "layout", str(tmp_path), "--json", str(tmp_path / "n.json")])
    assert result.exit_code == 0, result.output
    row = json.loads((tmp_path / "n.json").read_text())["maps"][0]
    assert row["a_fc"] > 0.9 and row["a_bc"] > 0.9 and row["truth_mirrored"]
    assert "rooms, truth mirrored" in result.output


def test_maps_at_their_own_scale_and_guessed_buildings_are_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for k, name in enumerate(("map1", "map2", "barn")):
        draw(tmp_path, name, 82 + 4 * k)
    (tmp_path / "index.csv").write_text("file,m_per_px\nmap1.png,0.04\nmap2.png,0.06\n")
    command = ["evaluate", "segmentation", str(tmp_path)]
    numbers, out = tmp_path / "numbers.json", tmp_path / "out"
    options = ["-m", "distance", "--json", str(numbers), "--out", str(out), "--resolution", "0.1"]
    result = runner.invoke(app, [*command, *options])
    assert result.exit_code == 0, result.output
    assert "note: 2 of 3 maps at the scale of their index.csv, 0.04 to 0.06 m a pixel" in result.output
    scales = {row["map"]: row["m_per_px"] for row in json.loads(numbers.read_text())["maps"]}
    assert scales == {"barn": 0.1, "map1": 0.04, "map2": 0.06}
    assert "0.04\N{EN DASH}0.1</b>m a pixel" in (out / "report.html").read_text()
    monkeypatch.setattr(
        "layoutexplore.evaluation.cross_validation.train_all_models", lambda *_: MergingModels(first_forest())
    )
    result = runner.invoke(app, [*command, "--folds", "2", "--simulated", "0"])
    assert result.exit_code == 0, result.output
    where = tmp_path.name
    assert f"the building of 2 maps is a guess, their folder: {where}/map1, {where}/map2" in result.output
