"""Wrong calls of what programs work with end in an error of ours that names the argument."""

from __future__ import annotations

import importlib
import inspect
import math
import pkgutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import layoutexplore.evaluation
import layoutexplore.maps.formats
import layoutexplore.metrics
from layoutexplore import FloorPlan, OccupancyGrid, Pose, Simulation, SimulationConfig
from layoutexplore.agents import make_agent
from layoutexplore.benchmark.config import BenchmarkConfig
from layoutexplore.benchmark.suite import load_suite
from layoutexplore.closed_doors import predict_closed_rooms
from layoutexplore.drawing.pictures import draw_grid, draw_plan, draw_state
from layoutexplore.drawing.prior_plans import side_by_side
from layoutexplore.envs.viewer import draw_text
from layoutexplore.errors import (
    ConfigError,
    LayoutExploreError,
    MapError,
    checks_arguments,
    checks_calls,
    shortened,
    unknown_name,
)
from layoutexplore.files import read_json, safe_name
from layoutexplore.grids.arrays import Cells, Mask
from layoutexplore.grids.image_map import grid_from_image
from layoutexplore.importing.building import building_from_grid, building_of_plan
from layoutexplore.importing.findings import find_faults
from layoutexplore.layout.doorways import DoorwaysConfig, doorway_regions
from layoutexplore.layout.outlines import label_polygons
from layoutexplore.maps.generator import generate
from layoutexplore.maps.raster import PlanRaster
from layoutexplore.maps.tracing import floorplan_from_ascii
from layoutexplore.metrics.exploration import auc_horizon, revisit_share
from layoutexplore.metrics.segmentation import overlap_table, score_segmentation
from layoutexplore.metrics.statistics import (
    cluster_bootstrap,
    cluster_means,
    improvements,
    interquartile_mean,
    log_ratios,
)
from layoutexplore.priors.evacuation_picture import draw_evacuation_plan
from layoutexplore.priors.plan import prior_of_plan
from layoutexplore.priors.reading import prior_of_picture
from layoutexplore.priors.spoiling import SpoilConfig, spoil
from layoutexplore.report.benchmark import write_benchmark_report
from layoutexplore.sensing.lidar import Lidar, sensor
from layoutexplore.sensing.mapper import Mapper
from layoutexplore.simulation.episode import play, run_seed, start_pose
from layoutexplore.simulation.region import read_region
from layoutexplore.simulation.way_back import return_to_start
from tests.plans import HOUSE


class Shy:
    """An object that cannot show itself."""

    def __repr__(self) -> str:
        raise RuntimeError


KINDS: tuple[Any, ...] = (
    None, "nonsense", b"x", 1j, [], {}, (), [None], {"a": 1}, [[1, 2], [3]], np.array("x"), object(), int,
    10**400, math.nan, math.inf, 1e300, Shy(), [Shy()],
)  # fmt: skip
"""Values of kinds that hardly any argument can be."""

PLAN = floorplan_from_ascii(HOUSE, resolution=0.6, name="house")


def simulation() -> Simulation:
    made = Simulation(PLAN, SimulationConfig(sensor="indoor"))
    made.reset(seed=0)
    return made


def raster() -> PlanRaster:
    return PLAN.rasterize(0.3)


THINGS: dict[type, Callable[[], Any]] = {
    OccupancyGrid: lambda: raster().grid,
    PlanRaster: raster,
    FloorPlan: lambda: PLAN,
    Mapper: lambda: Mapper((9, 9), 0.1, Pose(0.0, 0.0, 0.0)),
    Lidar: lambda: Lidar(sensor("indoor"), raster().occupied, 0.3, raster().origin),
    Simulation: simulation,
}
GOOD = {"robot_radius": 0.2, "x": 1.0, "y": 1.0, "row": 1, "col": 1, "choice": 0, "pose": Pose(3.0, 2.0, 0.0)}
"""Arguments that go with the one that is wrong."""


def methods() -> list[tuple[type, str, str]]:
    found = []
    for kind in THINGS:
        for name, method in inspect.getmembers(kind, inspect.isfunction):
            parameters = list(inspect.signature(method).parameters.values())[1:]
            needed = {p.name for p in parameters if p.default is p.empty}
            if not name.startswith("_"):
                found += [(kind, name, p.name) for p in parameters if needed <= {*GOOD, p.name}]
    return found


@pytest.mark.parametrize(("kind", "name", "argument"), methods())
def test_no_wrong_call_ends_in_an_error_of_python(kind: type, name: str, argument: str) -> None:
    thing, failures = THINGS[kind](), {}
    method = getattr(thing, name)
    needed = {p.name for p in inspect.signature(method).parameters.values() if p.default is p.empty}
    for value in KINDS:
        try:
            method(**{key: GOOD[key] for key in needed - {argument}}, **{argument: value})
        except LayoutExploreError:
            continue
        except Exception as error:
            failures[shortened(value)] = f"{type(error).__name__}: {error}"
    assert not failures


def test_there_are_many_methods() -> None:
    assert len(methods()) > 25


def with_one_wrong(function: Callable[..., Any], **good: Any) -> Callable[[str, Any], Any]:
    """Calls of a function with an argument replaced."""
    return lambda name, value: function(**{**good, name: value})


def functions() -> dict[str, tuple[Callable[[str, Any], Any], tuple[str, ...]]]:
    """Functions of pages and examples with arguments that they need, by name."""
    grid, rooms, seeded = raster().grid, raster().room_ids, np.random.default_rng(0)
    calls: list[tuple[Callable[..., Any], dict[str, Any]]] = [
        (auc_horizon, {"target_area": 9.0}),
        (revisit_share, {"track": [(0.0, 0.0), (1.0, 0.0)]}),
        (interquartile_mean, {"values": [1.0, 2.0]}),
        (cluster_bootstrap, {"values": [1.0, 2.0], "clusters": ["a", "b"]}),
        (cluster_means, {"values": [1.0, 2.0], "clusters": ["a", "b"]}),
        (log_ratios, {"values": [1.0, 2.0], "baseline": [1.0, 1.0]}),
        (improvements, {"differences": [1.0, -1.0]}),
        (score_segmentation, {"predicted": rooms, "truth": rooms, "free": grid.free}),
        (overlap_table, {"predicted": rooms[3], "truth": rooms[3]}),
        (doorway_regions, {"cells": grid.cells, "resolution": grid.resolution}),
        (find_faults, {"plan": PLAN}),
        (building_from_grid, {"grid": grid, "name": "house"}),
        (building_of_plan, {"plan": PLAN}),
        (spoil, {"plan": PLAN, "config": SpoilConfig(), "rng": seeded}),
        (prior_of_plan, {"plan": PLAN}),
        (prior_of_picture, {"image": np.zeros((9, 9, 3), np.uint8)}),
        (draw_evacuation_plan, {"free": grid.free, "room_ids": rooms, "resolution": 0.3, "rng": seeded}),
        (return_to_start, {"simulation": None}),
        (play, {"simulation": simulation(), "agent": make_agent("nearest")}),
        (make_agent("layout-tour").act, {"decision": simulation().decision}),
        (make_agent("wait").choose, {"decision": simulation().decision}),
        (make_agent("nearest").candidates, {"decision": simulation().decision}),
        (make_agent("cost-utility").scores, {"among": None}),
        (grid.cells_to_world, {"cells": [[0, 1]]}),
        (simulation().step, {"choice": 0}),
        (run_seed, {"seed": 0, "plan": "house", "start": 0}),
        (start_pose, {"plan": PLAN, "simulation": SimulationConfig(), "seed": 0, "start": 0}),
        (side_by_side, {"left": np.zeros((9, 9, 3), np.uint8), "right": np.zeros((9, 9, 3), np.uint8)}),
        (load_suite, {"name": "v1"}),
        (write_benchmark_report, {"folder": None}),
        (predict_closed_rooms, {"grid": grid}),
        (read_json, {"path": Path("nowhere.json"), "schema": None, "error": MapError}),
        (draw_grid, {"grid": grid, "scale": 1}),
        (draw_plan, {"raster": raster(), "scale": 1}),
        (draw_state, {"simulation": simulation(), "size": (640, 480), "target": 0, "agent": "x"}),
        (draw_text, {"simulation": simulation(), "columns": 80}),
        (label_polygons, {"labels": rooms}),
        (grid_from_image, {"grey": np.zeros((9, 9), np.uint8), "resolution": 0.1, "unknown_grey": "auto"}),
        (generate, {"family": "office", "seed": 1, "config": None}),
        (read_region, {"text": "0,0 1,0 1,1"}),
        (simulation().decision.path_lengths, {"chosen": [0]}),
        (safe_name, {"name": "x"}),
        (BenchmarkConfig, {"plans": ("office:1",), "cell_mb": 900, "cell_seconds": 9}),
        (floorplan_from_ascii, {"text": HOUSE, "resolution": 0.6}),
        (DoorwaysConfig, {"door_min": 0.5, "core": 0.3}),
    ]
    return {function.__name__: (with_one_wrong(function, **good), tuple(good)) for function, good in calls}


@pytest.mark.parametrize("name", functions())
def test_no_wrong_call_of_a_function_ends_in_an_error_of_python(name: str) -> None:
    call, arguments = functions()[name]
    failures = {}
    for argument in arguments:
        for value in KINDS:
            try:
                call(argument, value)
            except LayoutExploreError:
                continue
            except Exception as error:
                failures[argument, shortened(value)[:30]] = f"{type(error).__name__}: {error}"
    assert not failures


LOWER = (layoutexplore.metrics, layoutexplore.evaluation, layoutexplore.maps.formats)
"""Rooms all of whose functions are called with nonsense alone."""

EXPLAINED = {
    "engines": "starts processes",
    "floors_of_model": "runs in a process of its own, whatever it raises",
}
"""Functions that are not."""


def functions_of_rooms() -> list[Callable[..., Any]]:
    found = []
    for room in LOWER:
        for part in pkgutil.iter_modules(room.__path__):
            module = importlib.import_module(f"{room.__name__}.{part.name}")
            for name, function in [*vars(module).items()]:
                if inspect.isfunction(function) and function.__module__ == module.__name__:
                    found += [] if name.startswith("_") or name in EXPLAINED else [function]
    return found


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("function", functions_of_rooms(), ids=lambda f: f"{f.__module__}.{f.__name__}")
def test_nonsense_alone_ends_in_an_error_of_ours(function: Callable[..., Any]) -> None:
    """What a function can take, such as an empty list, it may take."""
    parameters = [p for p in inspect.signature(function).parameters.values() if p.default is p.empty]
    failures = {}
    for value in KINDS:
        given = [value for p in parameters if p.kind is p.POSITIONAL_OR_KEYWORD]
        named = {p.name: value for p in parameters if p.kind is p.KEYWORD_ONLY}
        try:
            result = function(*given, **named)
            if inspect.isgenerator(result):
                list(result)
        except LayoutExploreError:
            continue
        except Exception as error:
            failures[shortened(value)[:30]] = f"{type(error).__name__}: {error}"
    assert not failures


def test_kinds_of_what_a_call_was_given() -> None:
    """Texts are no lists of other things, measures no flags; mappings and generators are looked into."""

    @checks_arguments
    def names(parts: Sequence[FloorPlan], by_name: Mapping[str, int]) -> list[Any]:
        return [part.name for part in parts] + [value + 1 for value in by_name.values()]

    @checks_arguments
    def walk(parts: Sequence[int]) -> Iterator[int]:
        for part in parts:
            yield part + 1

    @checks_arguments
    def inverted(flags: Mask) -> Mask:
        return ~flags

    for call in (
        lambda: names("ab", {}),  # type: ignore[arg-type]
        lambda: names([], {"a": "b"}),  # type: ignore[dict-item]
        lambda: list(walk("ab")),  # type: ignore[arg-type]
        lambda: inverted(np.zeros(3)),  # type: ignore[arg-type]
    ):
        with pytest.raises(ConfigError, match="must be"):
            call()
    assert list(walk([1, 2])) == [2, 3] and names([PLAN], {"a": 1}) == ["house", 2]


def test_arrays_of_another_shape_are_named() -> None:
    flat, odd = np.zeros(3, np.int32), np.zeros((3, 3), np.int32)
    with pytest.raises(ConfigError, match="rows of x and y"):
        revisit_share(flat)
    with pytest.raises(ConfigError, match="as many clusters"):
        cluster_means([1.0, 2.0], ["a"])
    with pytest.raises(MapError, match="of one length"):
        overlap_table(flat, odd)
    with pytest.raises(MapError, match="three colours"):
        prior_of_picture(odd.astype(np.uint8))
    with pytest.raises(MapError, match="equal 2-d shapes"):
        draw_evacuation_plan(odd > 0, odd[:2], 0.1, np.random.default_rng(0))
    with pytest.raises(MapError, match="two-dimensional"):
        doorway_regions(flat, 0.1)  # type: ignore[arg-type]


def test_an_error_that_no_argument_explains_stays() -> None:
    @checks_calls
    class Thing:
        def part(self, index: int, parts: tuple[int, ...] = ()) -> float:
            return 1 / parts[index]

        def _hidden(self, index: int) -> str:
            return "a" + index  # type: ignore[operator]

        def unset(self) -> int:
            return self.never  # type: ignore[attr-defined,no-any-return]

    calls = {IndexError: "part(0)", ZeroDivisionError: "part(0, (0,))", AttributeError: "unset()"}
    for kind, call in calls.items():
        with pytest.raises(kind):
            eval(f"Thing().{call}", {"Thing": Thing})
    with pytest.raises(ConfigError, match=r"Thing.part: index must be int, got .x."):
        Thing().part("x")  # type: ignore[arg-type]
    with pytest.raises(TypeError):
        Thing()._hidden(0)


def test_alternatives_and_arrays_are_kinds() -> None:
    @checks_arguments
    def total(values: np.ndarray[Any, Any] | None, pose: Pose | None = None) -> float:
        return float(np.sum(values) + pose[3])  # type: ignore[index, operator]

    for values, pose, named in (("x", None, "values"), ([1], "ab", "pose"), ([1], (1, 2), "pose")):
        with pytest.raises(ConfigError, match=f"total: {named} must be"):
            total(values, pose)  # type: ignore[arg-type]
    with pytest.raises(IndexError):
        total([1], Pose(0.0, 0.0, 0.0))  # type: ignore[arg-type]


@checks_arguments
def first(cells: Cells, resolution: float = 1.0, parts: Sequence[int] = (1,)) -> float:
    return float(cells[0, 0]) / resolution + parts[round(resolution) - 1]


GRID = np.zeros((2, 2), np.int8)


def test_what_can_hardly_be_meant_is_told() -> None:
    """An argument of the right kind explains an error, too: an empty list, another type of array, a NaN."""
    assert first(GRID) == 1.0
    for told, given in {
        r"cells has the shape \(0, 2\)": {"cells": np.zeros((0, 2), np.int8)},
        "cells has values of type float64": {"cells": np.zeros(3)},
        "resolution is 1000000": {"cells": GRID, "resolution": 1e15},
        "parts is empty": {"cells": GRID, "parts": []},
    }.items():
        with pytest.raises(ConfigError, match=f"first: {told}"):
            first(**given)  # type: ignore[arg-type]
    with pytest.raises(IndexError):
        first(GRID, parts=Empty())


def test_a_fault_of_ours_at_an_ordinary_argument_stays_one() -> None:
    """Zeros, negative numbers, arrays of any dimension, defaults: the function itself has to refuse them."""
    for fault, given in (
        (ZeroDivisionError, {"cells": GRID, "resolution": 0.0}),
        (IndexError, {"cells": GRID, "resolution": -7.0}),
        (IndexError, {"cells": np.zeros(3, np.int8)}),
        (IndexError, {"cells": GRID, "resolution": 7.0, "parts": (1,)}),
    ):
        with pytest.raises(fault):
            first(**given)  # type: ignore[arg-type]

    def inner() -> float:
        return first(GRID, parts=[])

    with pytest.raises(ConfigError, match="parts is empty"):
        inner()
    ours: Callable[[], float] = eval(
        "lambda: first(GRID, parts=[])", {**globals(), "__name__": "layoutexplore.maps"}
    )
    with pytest.raises(IndexError):  # what the package itself has passed on
        ours()


def test_an_object_that_cannot_tell_its_fault_does_not_hide_the_error() -> None:
    faulty = type("Faulty", (list,), {"fault": property(lambda _: 1 / 0)})()
    with pytest.raises(ConfigError, match="parts is empty"):
        first(GRID, parts=faulty)


class Empty(Sequence[int]):
    """A list of a user's own whose errors are theirs."""

    def __len__(self) -> int:
        return 1

    def __getitem__(self, index: Any) -> Any:
        raise IndexError


def test_names_that_are_no_texts_are_unknown() -> None:
    for name in KINDS:
        assert "unknown thing" in str(unknown_name("thing", name, ["a", "b"]))


def test_a_fault_of_code_is_not_blamed_on_an_unusual_argument() -> None:
    @checks_arguments
    def broken(parts: Sequence[int]) -> None:
        raise AssertionError("never so")

    with pytest.raises(AssertionError, match="never so"):
        broken([])
