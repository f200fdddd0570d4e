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

import importlib.abc
import importlib.machinery
import importlib.util
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
    return sorted({*globals(), *_HOMES})


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


class _RegisteredLater(importlib.abc.MetaPathFinder):
    """Registers the environments as soon as Gymnasium is imported, which few processes do: it takes 11 MB."""

    def find_spec(
        self, fullname: str, path: Any, target: Any = None
    ) -> importlib.machinery.ModuleSpec | None:
        if fullname != "gymnasium":
            return None
        sys.meta_path.remove(self)
        spec = importlib.util.find_spec(fullname)
        if spec is None or spec.loader is None:
            return spec
        load = spec.loader.exec_module

        def load_and_register(module: ModuleType) -> None:
            load(module)
            _register()

        spec.loader.exec_module = load_and_register  # type: ignore[method-assign]
        return spec


if "gymnasium" in sys.modules:
    _register()
else:
    sys.meta_path.insert(0, _RegisteredLater())
