"""From scans to an occupancy grid.

Two ways: `Mapper.observe` casts exact rays in the true world and marks the robot's grid in the same pass;
`Mapper.integrate` takes ranges, noisy ones too, and weighs evidence in log odds (Hornung et al., "OctoMap",
2013, equations 2-4). Both follow the traversal rules of `layoutexplore.sensing.lidar` and keep one trinary
grid up to date in place.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from layoutexplore.errors import ConfigError, MapError
from layoutexplore.grids.boxes import Box
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid, Pose, check_resolution
from layoutexplore.sensing.lidar import (
    Lidar,
    LidarConfig,
    around,
    beam_table,
    check_upright,
    position_in_cells,
)
from layoutexplore.sensing.scan_kernels import Changes, cast_and_mark, weigh


@dataclass(frozen=True, kw_only=True)
class MapperConfig:
    """How evidence is weighed where ranges may be wrong. All values are log odds (natural logarithm).

    Attributes:
        hit: Added to the cell a beam ends in (OctoMap: 0.85, a probability of 0.7).
        miss: Subtracted from each cell a beam crosses (OctoMap: 0.4, a probability of 0.4).
        clamp: Least and greatest evidence a cell can hold (OctoMap: -2.0 and 3.5).
        free_below: At or below this evidence a cell is free.
        occupied_above: At or above this evidence a cell is occupied. In between it stays what it was.

    Raises:
        ConfigError: The values are not finite or not in order.
    """

    hit: float = 0.85
    miss: float = 0.4
    clamp: tuple[float, float] = (-2.0, 3.5)
    free_below: float = -0.4
    occupied_above: float = 0.85

    def __post_init__(self) -> None:
        values = (self.hit, self.miss, *self.clamp, self.free_below, self.occupied_above)
        if not all(math.isfinite(v) and abs(v) <= 100 for v in values):
            raise ConfigError(f"log odds must be finite and at most 100, got {self}")
        if not (self.hit > 0 and self.miss > 0):
            raise ConfigError(f"hit and miss must be above 0, got {self.hit} and {self.miss}")
        if not (self.clamp[0] <= self.free_below < self.occupied_above <= self.clamp[1]):
            raise ConfigError(f"thresholds must lie in order inside the clamp, got {self}")


class ScanUpdate(NamedTuple):
    """What a scan changed.

    Attributes:
        new_cells: Cells that were unknown and are known now.
        new_occupied: Cells that became occupied.
        box: (row0, row1, col0, col1), half open, around all cells whose value changed; (0, 0, 0, 0) when
            there is none.
    """

    new_cells: int
    new_occupied: int
    box: Box


class Mapper:
    """The robot's grid and the ways to add to it.

    Args:
        shape: (rows, cols) of the grid.
        resolution: Side of a cell in metres.
        origin: Pose of the lower left corner of cell (0, 0); its yaw must be 0.
        config: How `integrate` weighs evidence.

    Attributes:
        grid: The occupancy grid; all unknown at first, its cells change in place.
        known_free: Number of free cells.
        occupied_count: Number of occupied cells.
        config: How `integrate` weighs evidence.

    Memory: one byte a cell; `integrate` adds three more (evidence and marks) from its first call on. Use one
    of `observe` and `integrate` on a map: what is observed is no evidence that later scans are weighed
    against.

    Raises:
        MapError: The shape, the resolution or the origin is not usable.

    Example:
        >>> world = np.zeros((3, 6), bool)
        >>> world[:, 5] = True
        >>> lidar = Lidar(LidarConfig(range_max=5.0, fov=1.0, beams=1), world, 1.0, Pose(0, 0))
        >>> mapper = Mapper((3, 6), 1.0, Pose(0, 0))
        >>> mapper.observe(lidar, Pose(1.5, 1.5))
        ScanUpdate(new_cells=5, new_occupied=1, box=(1, 2, 1, 6))
        >>> mapper.grid.cells[1].tolist()
        [-1, 0, 0, 0, 0, 100]
    """

    def __init__(
        self, shape: tuple[int, int], resolution: float, origin: Pose, config: MapperConfig | None = None
    ) -> None:
        rows, cols = (int(n) for n in shape)
        if rows < 1 or cols < 1:
            raise MapError(f"a grid needs at least one cell, got shape {tuple(shape)}")
        check_resolution(resolution)
        check_upright(origin)
        self.config = config or MapperConfig()
        self.grid = OccupancyGrid(np.full((rows, cols), UNKNOWN, np.int8), float(resolution), Pose(*origin))
        self.known_free = 0
        self.occupied_count = 0
        self._evidence: NDArray[np.int16] | None = None
        self._touched: NDArray[np.uint8] | None = None
        self._stamp = 0

    def observe(self, lidar: Lidar, pose: Pose, *, full_turn: bool = False) -> ScanUpdate:
        """Look around in the true world, exactly: cells that a ray crosses become free, the cell it hits occupied.

        A cell that is occupied stays so; walls beyond the lidar's range are not marked, and neither is the
        outside.

        Args:
            lidar: The lidar in a world of the grid's shape, resolution and origin. Its noise is not used.
            pose: Where the robot stands.
            full_turn: Look all around, with the same density of beams.

        Raises:
            MapError: The lidar's world has another shape, resolution or origin.
            StartError: The pose is not finite.
        """
        grid = self.grid
        if (
            lidar.shape != grid.cells.shape
            or lidar.resolution != grid.resolution
            or lidar.origin != grid.origin
        ):
            raise MapError(
                f"the lidar's world (shape {lidar.shape}, resolution {lidar.resolution}, origin {tuple(lidar.origin)}) is not "
                f"that of the grid ({grid.shape}, {grid.resolution}, {tuple(grid.origin)})"
            )
        config = around(lidar.config) if full_turn else lidar.config
        col, row = position_in_cells(pose, grid.resolution, grid.origin)
        unit_x, unit_y = beam_table(config)
        changes = cast_and_mark(
            lidar.padded_clearance,
            grid.cells,
            col,
            row,
            math.cos(pose.theta),
            math.sin(pose.theta),
            unit_x,
            unit_y,
            config.range_max / grid.resolution,
            dense_reach(config),
            not config.full_turn,
            math.cos(pose.theta + config.angle_offset),
            math.sin(pose.theta + config.angle_offset),
        )
        return self.count(changes)

    def integrate(
        self, pose: Pose, ranges: NDArray[np.float32], config: LidarConfig, *, full_turn: bool = False
    ) -> ScanUpdate:
        """Weigh a scan as evidence; the grid's cells follow where the evidence crosses a threshold.

        Along a beam of a finite range the cells before its end gain evidence of being free, the cell it ends
        in of being occupied. A beam of +inf (no return) counts as free up to `range_max`; NaN (a failed beam)
        tells nothing. A cell is weighed once a scan; that a beam ended in it prevails over others that
        crossed it.

        Args:
            pose: Where the robot believes it stands.
            ranges: float32 (beams,) in metres.
            config: The lidar that measured them.
            full_turn: The ranges come from `Lidar.scan_full_turn`.

        Raises:
            ConfigError: The number of ranges is not that of the lidar's beams.
            StartError: The pose is not finite.
        """
        grid = self.grid
        lidar = around(config) if full_turn else config
        measured = np.asarray(ranges, np.float64)
        if measured.shape != (lidar.beams,):
            raise ConfigError(f"the lidar has {lidar.beams} beams, got ranges of shape {measured.shape}")
        col, row = position_in_cells(pose, grid.resolution, grid.origin)
        unit_x, unit_y = beam_table(lidar)
        evidence, touched = self._evidence_arrays()
        weights = self.config
        changes = weigh(
            grid.cells,
            evidence,
            touched,
            np.uint8(self._next_stamp(touched)),
            col,
            row,
            math.cos(pose.theta),
            math.sin(pose.theta),
            unit_x,
            unit_y,
            measured / grid.resolution,
            lidar.range_max / grid.resolution,
            _fixed(weights.hit),
            _fixed(weights.miss),
            np.array([_fixed(v) for v in (*weights.clamp, weights.free_below, weights.occupied_above)]),
        )
        return self.count(changes)

    def mark_occupied(self, cells: ArrayLike) -> ScanUpdate:
        """Mark cells that the robot has bumped into.

        Args:
            cells: int (n, 2) as (row, col); those outside of the grid are ignored.
        """
        rc = np.asarray(cells, np.int64).reshape(-1, 2)
        rows, cols = self.grid.cells.shape
        rc = rc[(rc[:, 0] >= 0) & (rc[:, 0] < rows) & (rc[:, 1] >= 0) & (rc[:, 1] < cols)]
        flat = np.unique(rc[:, 0] * cols + rc[:, 1])
        row, col = np.divmod(flat, cols)
        if self._evidence is not None:
            self._evidence[row, col] = _fixed(self.config.clamp[1])
        before = self.grid.cells[row, col]
        row, col, before = row[before != OCCUPIED], col[before != OCCUPIED], before[before != OCCUPIED]
        if row.size == 0:
            return ScanUpdate(0, 0, (0, 0, 0, 0))
        self.grid.cells[row, col] = OCCUPIED
        box = (int(row.min()), int(row.max()) + 1, int(col.min()), int(col.max()) + 1)
        new = int(np.count_nonzero(before == UNKNOWN))
        return self.count((new, row.size, -int(np.count_nonzero(before == FREE)), row.size, *box))

    def count(self, changes: Changes) -> ScanUpdate:
        """Add (new cells, new occupied, change of free, change of occupied, box) to the running counts."""
        new_cells, new_occupied, free_change, occupied_change, row0, row1, col0, col1 = changes
        self.known_free += free_change
        self.occupied_count += occupied_change
        return ScanUpdate(new_cells, new_occupied, (row0, row1, col0, col1))

    def _evidence_arrays(self) -> tuple[NDArray[np.int16], NDArray[np.uint8]]:
        """The evidence and the marks of the cells weighed in a scan, made on first use from what the grid holds."""
        if self._evidence is None or self._touched is None:
            cells = self.grid.cells
            self._evidence = np.zeros(cells.shape, np.int16)
            self._evidence[cells == FREE] = _fixed(self.config.free_below)
            self._evidence[cells == OCCUPIED] = _fixed(self.config.clamp[1])
            self._touched = np.zeros(cells.shape, np.uint8)
        return self._evidence, self._touched

    def _next_stamp(self, touched: NDArray[np.uint8]) -> int:
        self._stamp += 1
        if self._stamp == 256:
            touched[:] = 0
            self._stamp = 1
        return self._stamp


def dense_reach(config: LidarConfig) -> int:
    """How far, in cells along either axis, no cell in sight lies between two beams; -1 for fields of view of other shapes.

    A cell whose centre is r away is seen under an angle above 1 / (r + 1/2), so a beam meets it while beams
    are closer.
    """
    if not (config.full_turn or abs(config.fov - math.pi) < 1e-9):
        return -1
    r = 1.0 / (1.05 * config.angle_increment) - 0.5
    return math.floor(r / math.sqrt(2.0) - 0.5)


def _fixed(log_odds: float) -> int:
    """Log odds as the fixed-point number that the evidence array holds."""
    return round(log_odds * 100)
