"""Wrong calls of what programs work with end in an error of ours that names the argument."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from layoutexplore import FloorPlan, OccupancyGrid, Pose, Simulation, SimulationConfig
from layoutexplore.errors import ConfigError, LayoutExploreError, checks_arguments, checks_calls
from layoutexplore.maps.raster import PlanRaster
from layoutexplore.maps.tracing import floorplan_from_ascii
from layoutexplore.sensing.lidar import Lidar, sensor
from layoutexplore.sensing.mapper import Mapper
from tests.plans import HOUSE

KINDS: tuple[Any, ...] = (
    None, "nonsense", b"x", 1j, [], {}, (), [None], {"a": 1}, [[1, 2], [3]], np.array("x"), object(), int,
    10**400, math.nan, math.inf, 1e300,
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
            failures[repr(value)] = f"{type(error).__name__}: {error}"
    assert not failures


def test_there_are_many_methods() -> None:
    assert len(methods()) > 25


def test_an_error_that_no_argument_explains_stays() -> None:
    @checks_calls
    class Thing:
        def part(self, index: int, parts: tuple[int, ...] = ()) -> float:
            return 1 / parts[index]

        def _hidden(self, index: int) -> str:
            return "a" + index  # type: ignore[operator]

    with pytest.raises(IndexError):
        Thing().part(0)
    with pytest.raises(ZeroDivisionError):
        Thing().part(0, (0,))
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
