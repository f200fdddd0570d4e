"""`reconstruct`: from any occupancy grid to a layout, by a named method; and a cache for grids that grow."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from layoutexplore.errors import ConfigError, unknown_name
from layoutexplore.grids.grid import OCCUPIED, OccupancyGrid, Pose
from layoutexplore.layout.types import Layout
from layoutexplore.options import rule_like


def reconstruct(grid: OccupancyGrid, method: str = "default", config: Any = None) -> Layout:
    """Reconstruct the layout of a grid.

    Args:
        grid: Any occupancy grid, complete or partial, clean or cluttered.
        method: "default", "rose2", "ias15", "rose", "morphological", "distance" or "voronoi".
        config: The method's configuration: its dataclass, a mapping of options to change, or None for the
            defaults.

    Returns:
        The layout; one without rooms says why in `Layout.warnings`.

    Raises:
        UnknownNameError: No such method or option.
        ConfigError: The configuration belongs to another method.
    """
    chosen = layout_method(method)
    return chosen.run(grid, chosen.config(config))


class LayoutCache:
    """`reconstruct` that keeps its last layout while the walls it was made from have not changed.

    Almost half of the scans of an exploration add no occupied cell; segments, walls and lines then stay as
    they are, bit for bit. What a change of free cells alone does to the rooms is left out until a wall
    changes, unless `exact` is asked for.

    Args:
        method: As for `reconstruct`.
        config: As for `reconstruct`.
        exact: Reconstruct as soon as any cell has changed.
    """

    def __init__(self, method: str = "default", config: Any = None, *, exact: bool = False) -> None:
        self.method = layout_method(method)
        self.config = self.method.config(config)
        self.exact = exact
        self._seen: NDArray[Any] | None = None
        self._frame: tuple[float, Pose] | None = None
        self._layout: Layout | None = None

    def __call__(self, grid: OccupancyGrid) -> Layout:
        """The layout of the grid, or the last one while the cells that matter are the same."""
        seen = grid.cells.copy() if self.exact else grid.cells == OCCUPIED
        frame = grid.resolution, grid.origin
        if (
            self._layout is None
            or self._seen is None
            or frame != self._frame
            or not np.array_equal(seen, self._seen)
        ):
            self._layout = self.method.run(grid, self.config)
            self._seen, self._frame = seen, frame
        return self._layout


ConfigT = TypeVar("ConfigT")
Run = Callable[[OccupancyGrid, Any], Layout]

METHOD_MODULES: dict[str, str] = {
    "default": "layoutexplore.layout.merging.method",
    "rose2": "layoutexplore.layout.lines.rose2",
    "ias15": "layoutexplore.layout.lines.ias15",
    "rose": "layoutexplore.layout.lines.rose",
    "morphological": "layoutexplore.layout.survey.methods",
    "distance": "layoutexplore.layout.survey.methods",
    "voronoi": "layoutexplore.layout.survey.methods",
}
"""Where each method lives."""


@dataclass(frozen=True)
class LayoutMethod:
    """A named way to turn a grid into a layout."""

    name: str
    summary: str
    run: Run
    config_class: type[Any]

    def config(self, config: Any = None) -> Any:
        """The configuration to run with: the default, the given one, or the default changed by a mapping.

        Raises:
            ConfigError: An unknown key, a value of another kind than the default's, or a configuration of
                another method.
        """
        if config is None:
            return self.config_class()
        defaults = {f.name: f.default for f in fields(self.config_class)}
        if isinstance(config, self.config_class):
            self._converted({name: getattr(config, name) for name in defaults}, defaults)
            return config
        if isinstance(config, dict):
            return replace(self.config_class(), **self._converted(config, defaults))
        raise ConfigError(
            f"the {self.name} method takes a {self.config_class.__name__}, got {type(config).__name__}"
        )

    def _converted(self, options: Mapping[str, Any], defaults: Mapping[str, Any]) -> dict[str, Any]:
        """The options, each of the kind of its default."""
        for name in options:
            if name not in defaults:
                raise unknown_name(f"option of the {self.name} method", str(name), defaults)
        where = f"the {self.name} method's "
        return {
            name: rule_like(defaults[name]).convert(where + name, value) for name, value in options.items()
        }


_METHODS: dict[str, LayoutMethod] = {}


def register_method(
    name: str, summary: str, run: Callable[[OccupancyGrid, ConfigT], Layout], config_class: type[ConfigT]
) -> None:
    """Make a method of `reconstruct` known by name.

    Args:
        name: The method's name.
        summary: What it does, in one line.
        run: From a grid and the configuration to its layout.
        config_class: A frozen dataclass whose every field has a default.
    """
    if not is_dataclass(config_class):
        raise TypeError(f"{config_class.__name__} is not a dataclass")
    _METHODS[name] = LayoutMethod(name, summary, run, config_class)


def layout_method(name: str) -> LayoutMethod:
    """The method of that name.

    Raises:
        UnknownNameError: There is none.
    """
    if name not in _METHODS and name in METHOD_MODULES:
        importlib.import_module(METHOD_MODULES[name])
    if name not in _METHODS:
        raise unknown_name("layout method", name, method_names())
    return _METHODS[name]


def method_names() -> list[str]:
    """Every method, the default first."""
    return [*METHOD_MODULES, *(name for name in _METHODS if name not in METHOD_MODULES)]
