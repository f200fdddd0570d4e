"""layoutexplore: explore unknown buildings with a simulated lidar and a predicted layout.

`import layoutexplore` registers the Gymnasium environments `LayoutExplore/Frontier-v0` and
`LayoutExplore/Motion-v0`. The names below are loaded when they are first used, so that the import stays fast.
"""

from __future__ import annotations

import os
import signal
import sys
from pathlib import Path

# Asked to end while the command is still being loaded, it ends without a word; `processes.end_on_signals`
# takes over as soon as it can. Programs that import the package keep their own handlers.
if sys.orig_argv[1:3] == ["-m", "layoutexplore"] or Path((*sys.orig_argv, "")[1]).name == "layoutexplore":
    for _number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(_number, lambda number, frame: os._exit(128 + number))

import functools
import importlib.abc
import importlib.machinery
import importlib.util
from collections.abc import Callable
from types import ModuleType
from typing import TYPE_CHECKING, Any

from layoutexplore.processes.kernel_cache import keep_kernels_somewhere

__version__ = "0.2.0"

# In a checkout, envs/, agents/ and maps/ lie beside this folder; an installed wheel has them inside it.
_checkout = Path(__file__).resolve().parent.parent
if (_checkout / "pyproject.toml").is_file() and str(_checkout) not in __path__:
    __path__.append(str(_checkout))
keep_kernels_somewhere(Path(__file__).resolve().parent)

if TYPE_CHECKING:
    from layoutexplore.agents.base import make_agent as make_agent
    from layoutexplore.agents.base import register_agent as register_agent
    from layoutexplore.drawing.layouts import draw_layout as draw_layout
    from layoutexplore.drawing.pictures import draw_decision as draw_decision
    from layoutexplore.errors import LayoutExploreError as LayoutExploreError
    from layoutexplore.frontiers.decision import STOP as STOP
    from layoutexplore.frontiers.decision import Decision as Decision
    from layoutexplore.frontiers.table import Frontier as Frontier
    from layoutexplore.grids.grid import OccupancyGrid as OccupancyGrid
    from layoutexplore.grids.grid import Pose as Pose
    from layoutexplore.grids.ros_map import load_grid as load_grid
    from layoutexplore.grids.ros_map import save_grid as save_grid
    from layoutexplore.layout.export import layout_to_geojson as layout_to_geojson
    from layoutexplore.layout.pipeline import reconstruct as reconstruct
    from layoutexplore.layout.pipeline import register_layout as register_layout
    from layoutexplore.layout.types import Layout as Layout
    from layoutexplore.maps.floorplan import FloorPlan as FloorPlan
    from layoutexplore.maps.geojson import save_plan as save_plan
    from layoutexplore.maps.library import load_plan as load_plan
    from layoutexplore.predictors import register_predictor as register_predictor
    from layoutexplore.predictors.robot_map import RobotMap as RobotMap
    from layoutexplore.simulation.config import SimulationConfig as SimulationConfig
    from layoutexplore.simulation.saved_run import load_simulation as load_simulation
    from layoutexplore.simulation.saved_run import save_simulation as save_simulation
    from layoutexplore.simulation.simulation import Simulation as Simulation

_HOMES = {
    "STOP": "frontiers.decision",
    "Decision": "frontiers.decision",
    "Frontier": "frontiers.table",
    "LayoutExploreError": "errors",
    "FloorPlan": "maps.floorplan",
    "Layout": "layout.types",
    "OccupancyGrid": "grids.grid",
    "Pose": "grids.grid",
    "RobotMap": "predictors.robot_map",
    "draw_decision": "drawing.pictures",
    "draw_layout": "drawing.layouts",
    "layout_to_geojson": "layout.export",
    "load_grid": "grids.ros_map",
    "load_plan": "maps.library",
    "make_agent": "agents",
    "load_simulation": "simulation.saved_run",
    "save_simulation": "simulation.saved_run",
    "reconstruct": "layout.pipeline",
    "register_agent": "agents.base",
    "register_layout": "layout.pipeline",
    "register_predictor": "predictors",
    "save_grid": "grids.ros_map",
    "save_plan": "maps.geojson",
    "Simulation": "simulation.simulation",
    "SimulationConfig": "simulation.config",
}
__all__ = ["__version__", *sorted(_HOMES)]


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(importlib.import_module(f"layoutexplore.{_HOMES[name]}"), name)
    raise AttributeError(f"module 'layoutexplore' has no attribute {name!r}")


def __dir__() -> list[str]:
    own = {name for name in globals() if name.startswith("__") or f"{__name__}.{name}" in sys.modules}
    return sorted({*own, *_HOMES})  # What this file imports for itself is nobody's to complete.


def _register() -> None:
    import gymnasium

    for name in ("Frontier", "Motion"):
        identifier = f"LayoutExplore/{name}-v0"
        if identifier not in gymnasium.registry:
            gymnasium.register(
                identifier,
                entry_point=f"layoutexplore.envs.{name.lower()}:{name}Env",
                vector_entry_point=f"layoutexplore.envs.vector:{name}VectorEnv",
            )


def _picture(shown: Any) -> bytes | None:
    """A `_repr_png_`: what a notebook shows of a result. What draws it is loaded for the first one."""
    png: bytes | None = importlib.import_module("layoutexplore.drawing.notebook").notebook_png(shown)
    return png


def _give_picture(name: str, module: ModuleType) -> None:
    getattr(module, name)._repr_png_ = _picture


class _GoingOn(importlib.abc.Loader):
    """Loads a module as another loader does, which may be that of many modules, and takes a step more."""

    def __init__(self, loader: importlib.abc.Loader, step: Callable[[ModuleType], None]) -> None:
        self._loader, self._step = loader, step

    def __getattr__(self, name: str) -> Any:
        return getattr(self._loader, name)

    def create_module(self, spec: importlib.machinery.ModuleSpec) -> ModuleType | None:
        return self._loader.create_module(spec)

    def exec_module(self, module: ModuleType) -> None:
        module.__loader__ = self._loader
        if module.__spec__ is not None:
            module.__spec__.loader = self._loader
        self._loader.exec_module(module)
        self._step(module)


class _Afterwards(importlib.abc.MetaPathFinder):
    """Does something as soon as a module has been imported, which few processes do: Gymnasium takes 11 MB.

    Rooms that draw nothing do not know, either, that there are pictures of what is in them.
    """

    def __init__(self) -> None:
        self._steps: dict[str, Callable[[ModuleType], None]] = {
            "gymnasium": lambda module: _register(),
            **{
                f"layoutexplore.{_HOMES[name]}": functools.partial(_give_picture, name)
                for name in ("FloorPlan", "Layout", "OccupancyGrid")
            },
        }
        self._searched: set[str] = set()

    def find_spec(
        self, fullname: str, path: Any, target: Any = None
    ) -> importlib.machinery.ModuleSpec | None:
        if fullname not in self._steps or fullname in self._searched:
            return None
        self._searched.add(fullname)  # the search below asks this finder, too
        try:
            spec = importlib.util.find_spec(fullname)
        finally:
            self._searched.discard(fullname)
        if spec is not None and spec.loader is not None:
            spec.loader = _GoingOn(spec.loader, self._steps[fullname])
        return spec


sys.meta_path.insert(0, _Afterwards())
if "gymnasium" in sys.modules:
    _register()
