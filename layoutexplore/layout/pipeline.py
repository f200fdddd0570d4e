"""`reconstruct`: from any occupancy grid to a layout, by a named method; and a cache for grids that grow."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from layoutexplore.errors import ConfigError, checks_arguments, checks_calls, unknown_name
from layoutexplore.grids.arrays import Cells
from layoutexplore.grids.grid import OCCUPIED, OccupancyGrid, Pose
from layoutexplore.layout.outlines import layout_of_labels, room_numbers
from layoutexplore.layout.timing import StageTimer
from layoutexplore.layout.types import Layout
from layoutexplore.options import Rule, check_kind, rule_like
from layoutexplore.plugins.registry import Entry, Registry
from layoutexplore.plugins.signatures import check_takes


def reconstruct(grid: OccupancyGrid, method: str = "default", config: Any = None) -> Layout:
    """Reconstruct the layout of a grid.

    Args:
        grid: Any occupancy grid, complete or partial, clean or cluttered; of probabilities, `grid.trinary` is
            what methods see.
        method: "default" (also called "merging"), "rose2", "ias15", "rose", "morphological", "distance",
            "voronoi" or "doorways", with options as `NAME:key=value,...`; or one of your own,
            `FILE.py:FUNCTION` or `package.module:FUNCTION`.
        config: The method's configuration: its dataclass, a mapping of options to change, or None for the
            defaults.

    Returns:
        The layout; one without rooms says why in `Layout.warnings`.

    Raises:
        UnknownNameError: No such method or option.
        ConfigError: The configuration belongs to another method.
    """
    check_kind("grid", grid, OccupancyGrid)
    check_kind("method", method, str)
    chosen = layout_method(method)
    return chosen.run(grid.trinary, chosen.config(config)).completed()


@checks_calls
class LayoutCache:
    """`reconstruct` that keeps its last layout while the walls it was made from have hardly changed.

    Segments, walls and lines stay as they are, bit for bit, until an occupied cell changes. What a change of
    free cells alone does to the rooms is left out until a wall changes, unless `exact` is asked for.

    Args:
        method: As for `reconstruct`.
        config: As for `reconstruct`.
        exact: Reconstruct as soon as any cell has changed.
        growth: Of a map that is written into the same array, reconstruct as soon as the occupied cells that
            have changed are more than this share of those that there were.
    """

    def __init__(
        self, method: str = "default", config: Any = None, *, exact: bool = False, growth: float = 0.0
    ) -> None:
        if not 0 <= growth < 1:
            raise ConfigError(f"growth must lie in [0, 1), got {growth}")
        self.method = layout_method(method)
        self.config = self.method.config(config)
        self.exact, self.growth = exact, growth
        self._kept: _Kept | None = None

    def __call__(self, grid: OccupancyGrid, part: Callable[[], OccupancyGrid] | None = None) -> Layout:
        """The layout of the grid, or the last one while the cells that matter are the same.

        Args:
            grid: The grid.
            part: What the method is shown of it; all of it unless given.
        """
        grid = grid.trinary
        seen = grid.cells.copy() if self.exact else grid.cells == OCCUPIED
        frame, kept = (grid.resolution, grid.origin), self._kept
        if kept is None or frame != kept.frame or kept.differs(grid, seen):
            shown = part() if part else grid
            if np.may_share_memory(shown.cells, grid.cells):
                # Rooms are made when they are first looked at: the map may have grown by then.
                shown = replace(shown, cells=shown.cells.copy())
            most = 0 if self.exact else int(self.growth * np.count_nonzero(seen))
            kept = _Kept(self.method.run(shown, self.config), seen, most, grid.cells, frame)
            self._kept = kept  # at once: threads that share a cache never see half of it
        return kept.layout


class _Kept(NamedTuple):
    """The last layout of a `LayoutCache`, and the map that it was made from."""

    layout: Layout
    seen: NDArray[Any]
    most: int
    cells: Cells
    frame: tuple[float, Pose]

    def differs(self, grid: OccupancyGrid, seen: NDArray[Any]) -> bool:
        """Whether a map with these cells is to be reconstructed anew."""
        if seen.shape != self.seen.shape:
            return True
        # another map that looks nearly alike is no grown one
        most = self.most if self.cells is grid.cells else 0
        return int(np.count_nonzero(seen != self.seen)) > most


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
    "doorways": "layoutexplore.layout.doorways",
}
"""Where each method lives."""

ALIASES = {"merging": "default"}
"""Other names of methods: `default` is the one that ships, today `merging`."""


@dataclass(frozen=True)
class LayoutMethod:
    """A named way to turn a grid into a layout.

    Attributes:
        name: Of it.
        summary: What it does, in one line.
        run: From a grid and a configuration to the layout.
        default: The configuration it runs with unless told otherwise.
        digest: Changes with a user's own code; empty for what ships.
    """

    name: str
    summary: str
    run: Run
    default: Any
    digest: str = ""

    def config(self, config: Any = None) -> Any:
        """The configuration to run with: the default, the given one, or the default changed by a mapping.

        Raises:
            ConfigError: An unknown key, a value of another kind than the default's, or a configuration of
                another method.
        """
        if config is None:
            return self.default
        kind = type(self.default)
        rules = {field.name: rule_like(field.default) for field in fields(kind)}
        if isinstance(config, kind):
            self._converted({name: getattr(config, name) for name in rules}, rules)
            return config
        if isinstance(config, dict):
            return replace(self.default, **self._converted(config, rules))
        raise ConfigError(f"the {self.name} method takes a {kind.__name__}, got {type(config).__name__}")

    def _converted(self, options: Mapping[str, Any], rules: Mapping[str, Rule]) -> dict[str, Any]:
        """The options, each as its rule allows."""
        for name in options:
            if name not in rules:
                raise unknown_name(f"option of the {self.name} method", str(name), rules)
        where = f"the {self.name} method's "
        return {name: rules[name].convert(where + name, value) for name, value in options.items()}


def _accept(name: str, run: Any) -> Callable[[OccupancyGrid], Layout]:
    """A user's own method: from a grid to a layout, or to the room of each cell."""
    if not callable(run):
        kind = type(run).__name__
        raise ConfigError(f"layout method {name!r} is a {kind}, which cannot be called with a grid")

    check_takes(run, "grid", f"layout method {name!r}")

    def method(grid: OccupancyGrid) -> Layout:
        found = run(replace(grid, cells=grid.cells.copy()))  # it may change what it is given
        if isinstance(found, Layout):
            return found
        labels = room_numbers(found, grid.shape, f"layout method {name!r} gives no Layout")
        return layout_of_labels(name, grid, labels, StageTimer())

    return method


LAYOUTS: Registry[Callable[[OccupancyGrid], Layout]] = Registry(
    "layout method", "layoutexplore.layouts", _accept, module=__name__, homes=METHOD_MODULES, inputs=1
)
"""Every layout method by name."""


def register_layout(name: str, doc: str, build: Callable[..., Any], options: Any = None) -> None:
    """Make a method of `reconstruct` known by name.

    Args:
        name: The method's name.
        doc: What it does, in one line.
        build: Called with the name and the options; returns a function from a grid to its `Layout`, or to the
            room of each cell, int (rows, cols), 0 for none. Without options, such a function itself: its
            parameters after the grid, all with defaults, are the options.
        options: A frozen dataclass whose every field has a default.

    Raises:
        ConfigError: The name is taken by something else.
    """
    LAYOUTS.register(name, doc, build, options)


def register_method(
    name: str, summary: str, run: Callable[[OccupancyGrid, ConfigT], Layout], config_class: type[ConfigT]
) -> None:
    """Make a method that ships known by name.

    Args:
        name: The method's name.
        summary: What it does, in one line.
        run: From a grid and the configuration to its layout.
        config_class: A frozen dataclass whose every field has a default.
    """
    LAYOUTS.ship(name, summary, functools.partial(_waiting_for_grid, run), config_class())


def _waiting_for_grid(run: Run, name: str, config: Any) -> Callable[[OccupancyGrid], Layout]:
    del name
    return functools.partial(_run, run, config)


def _run(run: Run, config: Any, grid: OccupancyGrid) -> Layout:
    return run(grid, config)


@checks_arguments
def layout_method(spec: str) -> LayoutMethod:
    """The method of `NAME`, `NAME:key=value,...`, `FILE.py:FUNCTION` or `package.module:FUNCTION`.

    Raises:
        UnknownNameError: There is none, or it has no such option.
        ConfigError: The text is not of that form, or a value makes no sense.
        OwnCodeError: A user's own method cannot be loaded.
    """
    name, colon, rest = spec.partition(":")
    entry, options = LAYOUTS.find(ALIASES.get(name, name) + colon + rest)
    return LayoutMethod(entry.name, entry.doc, functools.partial(_run_entry, entry), options, entry.digest)


def _run_entry(entry: Entry[Callable[[OccupancyGrid], Layout]], grid: OccupancyGrid, config: Any) -> Layout:
    return LAYOUTS.build(entry, config)(grid)


def method_names() -> list[str]:
    """Every method, the default first."""
    return LAYOUTS.names()
