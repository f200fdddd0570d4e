"""`reconstruct`: from any occupancy grid to a layout, by a named method; and a cache for grids that grow."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from layoutexplore.grids.grid import OCCUPIED, OccupancyGrid, Pose
from layoutexplore.layout.registry import layout_method
from layoutexplore.layout.types import Layout


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
