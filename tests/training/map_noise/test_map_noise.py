"""Maps simulated with noise, what they are fitted to, and the command around it."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from typer.testing import CliRunner

from layoutexplore.cli import app
from layoutexplore.errors import ConfigError, MapError
from layoutexplore.grids.grid import FREE
from layoutexplore.maps import load_plan
from layoutexplore.maps.painted_rooms import find_cases, read_case
from layoutexplore.training.map_noise.files import describe_folders, read_noise, write_cases
from layoutexplore.training.map_noise.fit import (
    SimulatedMaps,
    check_counts,
    fit_noise,
    simulate_maps,
    told_apart,
)
from layoutexplore.training.map_noise.simulate import WIDE, MapNoise, MapNoiseConfig, NoisyMap, simulate_map
from layoutexplore.training.map_noise.statistics import describe_grid
from layoutexplore.training.merging_examples import Example
from layoutexplore.training.room_merging import training_examples

QUIET = MapNoise.draw(
    MapNoiseConfig(
        **dict.fromkeys(MapNoise._fields, (0.0, 0.0))
        | {"resolution": (0.1, 0.1), "range_max": (12.0, 12.0), "beams": (720, 720)}
        | {"explored": (2.0, 2.0), "spacing": (1.0, 1.0)}
    ),
    np.random.default_rng(0),
)
"""No noise at all, everything explored."""

FAST = dataclasses.replace(WIDE, resolution=(0.08, 0.12), beams=(90, 180), spacing=(2.0, 4.0))
PLANS = [f"apartment:{k}" for k in range(4)]


TINY = NoisyMap(np.zeros((1, 1), np.int8), np.zeros((1, 1), np.int32), 0.1, QUIET)


def test_every_range_of_noise_is_drawn_from() -> None:
    """The two classes name the same numbers: one that the noise of a map lacked would go unheard."""
    assert MapNoise._fields == tuple(field.name for field in dataclasses.fields(MapNoiseConfig))


def test_without_noise_the_map_is_the_building() -> None:
    plan = load_plan("apartment:1")
    made = simulate_map(plan, QUIET, np.random.default_rng(0))
    assert made is not None
    raster = plan.rasterize(0.1, margin=3.0)
    free = made.cells == FREE
    assert (raster.room_ids[free] > 0).mean() > 0.9
    assert not (free & raster.occupied).sum() > 0.02 * free.sum()
    assert free[raster.room_ids > 0].mean() > 0.8
    assert np.array_equal(made.rooms, raster.room_ids)


@pytest.mark.parametrize(
    ("noise", "statistic", "sign"),
    [
        ({"drift": 0.1, "turn_drift": 0.02}, "thickness", 1),
        ({"furniture": 0.5, "desks": 1.0}, "things", 1),
        ({"dust": 2.0}, "specks", 1),
        ({"broken": 0.4}, "wall_run", -1),
        ({"glass": 3.0, "passed": 1.0}, "frayed", 1),
        ({"explored": 0.2}, "frayed", 1),
    ],
)
def test_each_noise_moves_what_it_should(noise: dict[str, float], statistic: str, sign: int) -> None:
    plan = load_plan("apartment:1")
    quiet, loud = (
        simulate_map(plan, QUIET._replace(**changed), np.random.default_rng(1)) for changed in ({}, noise)
    )
    assert quiet is not None and loud is not None
    was, now = (getattr(describe_grid(one.cells, 0.1), statistic) for one in (quiet, loud))
    assert sign * (now - was) > 0, (was, now)


def test_the_same_seed_gives_the_same_maps_and_huge_plans_are_left_out() -> None:
    one, two = (simulate_maps(PLANS, FAST, 2, seed=3) for _ in range(2))
    assert all(np.array_equal(a.cells, b.cells) for a, b in zip(one.maps, two.maps, strict=True))
    assert simulate_map(load_plan("apartment:1"), QUIET, np.random.default_rng(0), largest=10.0) is None


@pytest.mark.slow
def test_a_fit_finds_the_noise_that_maps_were_made_with() -> None:
    only = MapNoiseConfig(**{k: (v, v) for k, v in QUIET._replace(spacing=2.5)._asdict().items()})
    wide = dataclasses.replace(only, broken=(0.0, 0.6))
    real = simulate_maps(PLANS, dataclasses.replace(wide, broken=(0.4, 0.6)), 16, seed=5).statistics()
    low, high = fit_noise(real, simulate_maps(PLANS, wide, 40, seed=6), wide, 0.3).broken
    assert 0.25 < low <= high
    clean = simulate_maps(PLANS, dataclasses.replace(wide, broken=(0.0, 0.05)), 16, seed=8)
    assert told_apart(real, [str(k) for k in range(len(real))], clean) > 0.9
    with pytest.raises(ConfigError, match="at least 10"):
        told_apart(real[:3], ["a"] * 3, clean)


def test_too_few_maps_are_told_with_what_makes_more() -> None:
    none = SimulatedMaps((), ())
    table = np.random.default_rng(0).random((24, 10))
    with pytest.raises(ConfigError, match="24 real, 0 simulated; --count N tries more"):
        fit_noise(table, none, MapNoiseConfig(), 0.3)
    with pytest.raises(ConfigError, match=r"3 real, 20 simulated$"):
        check_counts(3, 20)


def test_maps_of_one_building_cannot_be_told_apart_held_out() -> None:
    """Held out, no map of its kind is left to learn from: the area would be far below chance."""
    table = np.random.default_rng(0).random((24, 10))
    many, one = [f"b{k}" for k in range(12)], ["b"] * 12

    class Made(SimulatedMaps):
        def statistics(self) -> NDArray[np.float64]:
            return table[12:]

    def area(real: list[str], simulated: list[str]) -> float:
        return told_apart(table[:12], real, Made((TINY,) * 12, tuple(simulated)))

    assert np.isnan([area(one, many), area(many, one)]).all()
    assert 0.0 < area(many, many) < 1.0
    assert 0.0 <= area(["a", "b"] * 6, ["c", "d"] * 6) <= 1.0  # fewer buildings than folds


def test_written_maps_are_cases_with_their_buildings(tmp_path: Path) -> None:
    made = simulate_maps(PLANS, dataclasses.replace(FAST, resolution=(0.05, 0.05)), 4, seed=2)
    assert len(made.maps) > 1 and write_cases(made, tmp_path) == len(made.maps)
    grid, truth, _ = read_case(find_cases([tmp_path])[0], 0.05)
    assert np.array_equal(grid.cells, made.maps[0].cells)
    known = (grid.cells == FREE) & (truth > 0)
    pairs = np.unique(np.stack([truth[known], made.maps[0].rooms[known]]), axis=1)
    assert len(set(pairs[0])) == len(set(pairs[1])) == pairs.shape[1]
    assert "map,building" in (tmp_path / "buildings.csv").read_text()


def test_written_maps_are_read_and_learnt_from_at_their_own_scale(tmp_path: Path) -> None:
    made = simulate_maps(PLANS, dataclasses.replace(FAST, resolution=(0.08, 0.12)), 3, seed=2)
    count = write_cases(made, tmp_path)
    cases = find_cases([tmp_path])
    scales = [read_case(case, 0.05)[0].resolution for case in cases]
    assert count == len(scales) and sorted(scales) == sorted(one.resolution for one in made.maps)
    # One folder counts once, however it is named.
    table, _, _ = describe_folders([tmp_path, tmp_path / ".." / tmp_path.name], 0.05)
    assert np.allclose(np.sort(table, 0), np.sort(made.statistics(), 0))
    seen: list[float] = []

    def spy(cells: object, truth: object, resolution: float, **_: object) -> list[Example]:
        seen.append(resolution)
        return []

    with pytest.MonkeyPatch.context() as patch:
        for name in ("make_example", "explored_examples"):
            patch.setattr(f"layoutexplore.training.room_merging.{name}", spy)
        training_examples(cases, 0.05)
    assert set(seen) == set(scales)


def test_bad_ranges_and_folders_are_named(tmp_path: Path) -> None:
    file = tmp_path / "noise.toml"
    for text, said in (
        ("drift = [0.1]", "two numbers"),
        ("drift = [0.2, 0.1]", "drift"),
        ("drfit = [0.0, 0.1]", "drfit"),
        ("dropout = [0.0, 1.0]", "dropout"),
        ("resolution = [0.0, 1.0]", "above 0"),
    ):
        file.write_text(text)
        with pytest.raises(ConfigError, match=said):
            read_noise(file)
    file.write_text("drift = [0.0, 0.1]\n")
    assert read_noise(file).drift == (0.0, 0.1)
    with pytest.raises(MapError, match="no such folder"):
        describe_folders([tmp_path / "nowhere"], 0.05)
    with pytest.raises(MapError, match="no map"):
        describe_folders([tmp_path], 0.05)
    blank = tmp_path / "blank"
    blank.mkdir()
    cv2.imwrite(str(blank / "nothing.png"), np.full((20, 30), 205, np.uint8))
    with pytest.raises(MapError, match=r"nothing\.png: a map without free"):
        describe_folders([blank], 0.05)
    assert write_cases(simulate_maps(PLANS, FAST, 4), tmp_path)
    name = find_cases([tmp_path])[0].image.name
    for scale in ("wide", "-1"):
        (tmp_path / "index.csv").write_text(f"file,m_per_px\n{name},{scale}\n")
        with pytest.raises(MapError, match="m_per_px"):
            describe_folders([tmp_path], 0.05)


@pytest.mark.slow
def test_the_command_prints_statistics_and_writes_what_is_wanted(tmp_path: Path) -> None:
    write_cases(simulate_maps(PLANS, FAST, 24, seed=4), tmp_path / "real")
    (tmp_path / "real/cut_off.png").write_bytes(b"no picture")
    start = tmp_path / "start.toml"
    start.write_text("resolution = [0.1, 0.1]\nspacing = [3.0, 4.0]\nbeams = [90, 180]\n")
    out, maps, numbers = tmp_path / "noise.toml", tmp_path / "maps", tmp_path / "numbers.json"
    command = ["evaluate", "map-noise", str(tmp_path / "real"), "--plans", "apartment:0-3", "--count", "20"]
    command += ["--noise", str(start), "--resolution", "0.1", "--out", str(out), "--maps", str(maps)]
    result = CliRunner().invoke(app, [*command, "--json", str(numbers)])
    assert result.exit_code == 1, (result.output, result.exception)
    assert "failed: " in result.output.splitlines()[-1] and "cut_off.png" in result.output.splitlines()[-1]
    assert "specks" in result.output and "area under the ROC curve" in result.output
    assert read_noise(out).resolution == (0.1, 0.1)
    assert len(find_cases([maps])) >= 15
    assert 0 <= json.loads(numbers.read_text())["auc"]["fitted"] <= 1


def test_maps_are_written_with_their_scales_or_not_at_all(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without them, who reads the folder takes its maps for those of another scale."""

    def stop(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("layoutexplore.training.map_noise.files.write_csv", stop)
    with pytest.raises(KeyboardInterrupt):
        write_cases(simulate_maps(PLANS, FAST, 4), tmp_path / "maps")
    assert not (tmp_path / "maps").exists()
