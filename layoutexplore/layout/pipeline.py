"""`reconstruct`: from any occupancy grid to a layout, by a named method."""

from __future__ import annotations

from typing import Any

from layoutexplore.grid import OccupancyGrid
from layoutexplore.layout.registry import layout_method
from layoutexplore.layout.types import Layout


def reconstruct(grid: OccupancyGrid, method: str = "default", config: Any = None) -> Layout:
    """Reconstruct the layout of a grid.

    Args:
        grid: Any occupancy grid, complete or partial, clean or cluttered.
        method: "default", "rose2", "ias15", "rose", "morphological", "distance" or "voronoi".
        config: The method's configuration: its dataclass, a mapping of options to change, or None for the defaults.

    Returns:
        The layout; one without rooms says why in `Layout.warnings`.

    Raises:
        UnknownNameError: No such method or option.
        ConfigError: The configuration belongs to another method.
    """
    chosen = layout_method(method)
    return chosen.run(grid, chosen.config(config))
