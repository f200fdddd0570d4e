"""From scans to an occupancy grid.

Two methods: `Mapper.observe` casts exact rays in the true world and updates the robot's grid in the same
pass; `Mapper.integrate` takes ranges, noisy ones too, and updates log odds (Hornung et al., "OctoMap", 2013,
equations 2-4). Both follow the traversal rules of `layoutexplore.sensing.lidar` and keep one trinary
grid up to date in place.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from layoutexplore.errors import ConfigError, MapError, checks_calls, checks_making
from layoutexplore.grids.arrays import Bytes, Floats32
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
from layoutexplore.sensing.log_odds import EvidenceGrid, LogOddsRule, update_log_odds
from layoutexplore.sensing.scan_kernels import Changes, FieldOfView, update_occupancy


@checks_making
@dataclass(frozen=True, kw_only=True)
class MapperConfig:
    """How evidence is weighed where ranges may be wrong. All values are log odds (natural logarithm).

    Attributes:
        hit: Added to the cell a beam ends in (OctoMap: 0.85, a probability of 0.7).
        miss: Subtracted from each cell a beam crosses (OctoMap: 0.4, a probability of 0.4).
        clamp: Least and greatest evidence a cell can hold (OctoMap: -2.0 and 3.5).
        free_below: At or below this evidence a cell is free.
        occupied_above: At or above this evidence a cell is occupied. In between it stays what it was.
        hit_share: A cell is hit by a scan where this share (0..1, not 0) of the beams into it end in it, else
            it is missed: of a doorway's beams some always end beside its jambs.

    Evidence is kept in hundredths, and the share in per cent: what rounds to 0 is none.

    Raises:
        ConfigError: The values are not finite, out of their range, or not in order.
    """

    hit: float = 0.85
    miss: float = 0.4
    clamp: tuple[float, float] = (-2.0, 3.5)
    free_below: float = -0.4
    occupied_above: float = 0.85
    hit_share: float = 0.1

    def __post_init__(self) -> None:
        values = (self.hit, self.miss, *self.clamp, self.free_below, self.occupied_above)
        if not all(math.isfinite(v) and abs(v) <= 100 for v in values):
            raise ConfigError(f"log odds must be finite and at most 100, got {self}")
        if not 0 < self.hit_share <= 1:
            raise ConfigError(f"hit_share must be above 0 and at most 1, got {self.hit_share}")
        rule = self.in_hundredths
        if not (rule.hit > 0 and rule.miss > 0 and rule.hit_share > 0):
            raise ConfigError(f"hit, miss and hit_share must be 0.01 or more when rounded, got {self}")
        if not (rule.least <= rule.free_below < rule.occupied_above <= rule.most):
            raise ConfigError(f"thresholds must lie in order inside the clamp, got {self}")

    @property
    def in_hundredths(self) -> LogOddsRule:
        """The values as fixed-point numbers, as evidence is kept."""
        weights = (self.hit, self.miss, *self.clamp, self.free_below, self.occupied_above, self.hit_share)
        return LogOddsRule(*(round(100 * value) for value in weights))


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


@checks_calls
class Mapper:
    """The robot's grid and the methods that add to it.

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

    Memory: one byte a cell; `integrate` adds seven more (evidence, marks and counts of hits) from its first
    call on. Use one of `observe` and `integrate` on a map: what is observed is no evidence that later scans
    are weighed against.

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
        self._rule = self.config.in_hundredths
        self._evidence: EvidenceGrid | None = None
        self._last_view: tuple[LidarConfig, FieldOfView] | None = None
        self._stamp = 0

    def observe(self, lidar: Lidar, pose: Pose, *, full_turn: bool = False) -> ScanUpdate:
        """Look around in the true world: cells that a ray crosses become free, the one it hits occupied.

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
                f"the lidar's world (shape {lidar.shape}, resolution {lidar.resolution}, "
                f"origin {tuple(lidar.origin)}) is not that of the grid "
                f"({grid.shape}, {grid.resolution}, {tuple(grid.origin)})"
            )
        config = around(lidar.config) if full_turn else lidar.config
        col, row = position_in_cells(pose, grid.resolution, grid.origin)
        view = self._view(config)
        changes = update_occupancy(lidar.padded_clearance, grid.cells, col, row, float(pose.theta), view)
        return self.count(changes)

    def integrate(
        self, pose: Pose, ranges: Floats32, config: LidarConfig, *, full_turn: bool = False
    ) -> ScanUpdate:
        """Weigh a scan as evidence; the grid's cells follow where the evidence crosses a threshold.

        Along a beam of a finite range the cells before its end gain evidence of being free, the cell it ends
        in of being occupied. A beam of +inf (no return) counts as free up to `range_max`; NaN or a negative
        range (a failed beam) tells nothing. A cell is weighed once a scan: that beams ended in it prevails
        over others that crossed it where they are `MapperConfig.hit_share` of them or more.

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
        evidence = self._evidence_grid()
        changes = update_log_odds(
            evidence,
            np.uint8(self._next_stamp(evidence.touched)),
            col,
            row,
            float(pose.theta),
            self._view(lidar),
            measured / grid.resolution,
            self._rule,
        )
        return self.count(changes)

    def mark_occupied(self, cells: ArrayLike) -> ScanUpdate:
        """Mark cells that the robot has bumped into.

        Args:
            cells: int (n, 2) as (row, col); those outside of the grid are ignored.
        """
        rc = np.asarray(cells, np.int64).reshape(-1, 2)
        inside = ((rc >= 0) & (rc < self.grid.shape)).all(axis=1)
        row, col = np.unique(rc[inside], axis=0).T
        if self._evidence is not None:
            self._evidence.log_odds[row, col] = self._rule.most
        before = self.grid.cells[row, col]
        changes = before != OCCUPIED
        if not changes.any():
            return ScanUpdate(0, 0, (0, 0, 0, 0))
        row, col, before = row[changes], col[changes], before[changes]
        self.grid.cells[row, col] = OCCUPIED
        box = (int(row.min()), int(row.max()) + 1, int(col.min()), int(col.max()) + 1)
        new = int(np.count_nonzero(before == UNKNOWN))
        was_free = int(np.count_nonzero(before == FREE))
        return self.count((new, row.size, -was_free, row.size, *box))

    def count(self, changes: Changes) -> ScanUpdate:
        """Add changes of the cells to the running counts."""
        new, new_occupied, free_change, occupied_change, row0, row1, col0, col1 = changes
        self.known_free += free_change
        self.occupied_count += occupied_change
        return ScanUpdate(new, new_occupied, (row0, row1, col0, col1))

    def _view(self, config: LidarConfig) -> FieldOfView:
        """What a lidar sees; mostly it is the one of the scan before, known without comparing its fields."""
        if self._last_view is None or self._last_view[0] is not config:
            self._last_view = config, field_of_view(config, self.grid.resolution)
        return self._last_view[1]

    def _evidence_grid(self) -> EvidenceGrid:
        """The evidence and the stamps, made on first use from what the grid holds."""
        if self._evidence is None:
            cells = self.grid.cells
            log_odds = np.zeros(cells.shape, np.int16)
            log_odds[cells == FREE] = self._rule.free_below
            log_odds[cells == OCCUPIED] = self._rule.most
            self._evidence = EvidenceGrid(
                cells, log_odds, np.zeros(cells.shape, np.uint8), np.zeros(cells.shape, np.int32)
            )
        return self._evidence

    def _next_stamp(self, touched: Bytes) -> int:
        self._stamp += 2
        if self._stamp >= 255:
            touched[:] = 0
            self._stamp = 1
        return self._stamp


@lru_cache(maxsize=32)
def field_of_view(config: LidarConfig, resolution: float) -> FieldOfView:
    """What a lidar sees on a grid of that resolution, kept between calls."""
    dense = _dense_reach(config)
    reach = config.range_max / resolution
    unit_x, unit_y = beam_table(config)
    middle, increment = float(config.angle_offset), float(config.angle_increment)
    return FieldOfView(unit_x, unit_y, middle, increment, reach, dense, not config.full_turn)


def _dense_reach(config: LidarConfig) -> int:
    """How far, in cells along either axis, no cell in sight lies between two beams; -1 when unknown.

    A cell whose centre is r away is seen under an angle above 1 / (r + 1/2), so a beam meets it while beams
    are closer.
    """
    if not (config.full_turn or abs(config.fov - math.pi) < 1e-9):
        return -1
    r = 1.0 / (1.05 * config.angle_increment) - 0.5
    return math.floor(r / math.sqrt(2.0) - 0.5)
