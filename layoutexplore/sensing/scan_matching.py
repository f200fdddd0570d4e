"""Where a scan fits the map: correlative scan matching around the pose that odometry tells.

A robot's SLAM corrects its odometry by laying each new scan over the map made so far. The map is kept as the
mean of the points measured in each cell, which is finer than the cell (Grisetti, Stachniss and Burgard,
"Improved techniques for grid mapping with Rao-Blackwellized particle filters", 2007); poses are searched from
coarse to fine (Olson, "Real-time correlative scan matching", 2009), and how far odometry can be wrong weighs
against how well a scan fits. The two sides of a wall are two surfaces: a beam is compared with the one that
it can have met. The pose found is refined on the lines of the walls
(`layoutexplore.sensing.pose_refinement`): what a lattice leaves of the heading is what bends a map. There is
no loop closure: where the map is bent it stays bent.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from layoutexplore.errors import checks_calls
from layoutexplore.grids.arrays import Floats, Floats32, Ints
from layoutexplore.grids.grid import OccupancyGrid, Pose
from layoutexplore.options import COUNT, POSITIVE, Rule, check
from layoutexplore.sensing.lidar import LidarConfig, around, beam_table, position_in_cells
from layoutexplore.sensing.measured_points import (
    MeasuredPoints,
    add_points,
    is_turned_away,
    nearest_mean,
    no_points,
)
from layoutexplore.sensing.pose_refinement import REACH, MatchModel, PoseInCells, refine_pose


@dataclass(frozen=True, kw_only=True)
class ScanMatcherConfig:
    """How scans are matched with the map.

    Attributes:
        beams: Number of a scan's beams that the search compares, evenly spread over those that met something;
            the refinement takes all.
        spread: Standard deviation in metres of a measured point around the mean of its cell's points.
        weight: Natural logarithm of how much likelier a point is on a wall than anywhere; beams beside each
            other tell the same, so it is less than for beams alone.
        levels: Number of times that the steps of the search are halved, before the pose is refined.

    Raises:
        ConfigError: A value is out of its range.
    """

    beams: int = 90
    spread: float = 0.05
    weight: float = 0.5
    levels: int = 1

    def __post_init__(self) -> None:
        check(self, beams=COUNT, spread=POSITIVE, weight=POSITIVE, levels=Rule(kind=int, low=1, high=12))


_TURN = 0.02
"""Radians: at eight metres, between two headings so far apart, points move by a few spreads."""

_STEPS = 12
"""At most so many steps of the first lattice to either side."""

_LEAST = 1e-9
"""Metres and radians: a pose that odometry is surer of than this does not move."""

_FEW = 30
"""So many points are compared where the first lattice is wide."""


@checks_calls
class ScanMatcher:
    """Corrects poses by the map that a robot makes.

    Args:
        grid: The robot's grid, which a mapper changes in place.
        config: How to match.

    Attributes:
        overlap: Of the last scan matched, the number of points compared that lie on walls known before.
    """

    def __init__(self, grid: OccupancyGrid, config: ScanMatcherConfig | None = None) -> None:
        self.config = config or ScanMatcherConfig()
        self._grid = grid
        self.overlap = 0.0
        self._points = no_points(grid.cells.shape)

    def match(
        self,
        pose: Pose,
        ranges: Floats32,
        lidar: LidarConfig,
        *,
        position_std: float,
        heading_std: float,
        full_turn: bool = False,
    ) -> Pose:
        """The pose near to a believed one from which the ranges fit the map best.

        Args:
            pose: Where the robot believes it stands.
            ranges: float32 (beams,) in metres, as `Mapper.integrate` takes them.
            lidar: The lidar that measured them.
            position_std: How far the position may be wrong along x and along y, in metres.
            heading_std: How far the heading may be wrong, in radians.
            full_turn: The ranges come from `Lidar.scan_full_turn`.

        Returns:
            The corrected pose; the believed one where nothing of the map is in sight.
        """
        ends, self.overlap = self._ends(ranges, lidar, full_turn), 0.0
        position_std, heading_std = (std if std > _LEAST else 0.0 for std in (position_std, heading_std))
        if len(ends) == 0 or (position_std <= 0.0 and heading_std <= 0.0):
            return pose
        grid, size = self._grid, self._grid.resolution
        x, y = position_in_cells(pose, size, grid.origin)
        model = MatchModel(self.config.spread / size, self.config.weight, position_std / size, heading_std)
        believed = (x, y, float(pose.theta))
        some = evenly_chosen(ends, self.config.beams)
        # Where the robot was lost, many poses are tried with few points; the refinement takes all again.
        is_wide = position_std > 2.0 * self.config.spread or heading_std > 2.0 * _TURN
        searched = evenly_chosen(some, _FEW) if is_wide else some
        found = search_pose(self._points, searched, believed, model, self.config.levels)
        found = refine_pose(self._points, ends, found, believed, model)
        self.overlap = match_score(self._points, some, found, model.spread)
        return Pose(grid.origin.x + found[0] * size, grid.origin.y + found[1] * size, found[2])

    def add(self, pose: Pose, ranges: Floats32, lidar: LidarConfig, *, full_turn: bool = False) -> None:
        """Keep the points of a scan that the mapper has integrated from the same pose."""
        grid = self._grid
        config = around(lidar) if full_turn else lidar
        measured = np.asarray(ranges, np.float64) / grid.resolution
        x, y = position_in_cells(pose, grid.resolution, grid.origin)
        add_points(self._points, x, y, float(pose.theta), *beam_table(config), measured)

    def _ends(self, ranges: Floats32, lidar: LidarConfig, full_turn: bool) -> Floats:
        """Measured points float64 (n, 2) as the robot sees them, in cells."""
        config = around(lidar) if full_turn else lidar
        met = np.flatnonzero(np.isfinite(ranges))
        unit_x, unit_y = beam_table(config)
        lengths = ranges[met].astype(np.float64) / self._grid.resolution
        return np.column_stack([lengths * unit_x[met], lengths * unit_y[met]])


def evenly_chosen(ends: Floats, most: int) -> Floats:
    """At most so many of the points float64 (n, 2), evenly spread over them."""
    if len(ends) <= most:
        return ends
    return ends[np.linspace(0, len(ends) - 1, most).astype(np.int64)]


@njit(cache=True, nogil=True)
def match_score(points: MeasuredPoints, ends: Floats, pose: PoseInCells, spread: float) -> float:
    """Sum over a scan's ends of exp(-d^2 / 2 spread^2), d to the nearest mean in the 3 x 3 cells around."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    arms = np.empty_like(ends)
    for i in range(len(ends)):
        arms[i, 0], arms[i, 1] = ends[i, 0] * cos - ends[i, 1] * sin, ends[i, 0] * sin + ends[i, 1] * cos
    return _score_above(points, arms, pose, spread, -np.inf)


@njit(cache=True, nogil=True)
def search_pose(
    points: MeasuredPoints, ends: Floats, prior: PoseInCells, model: MatchModel, levels: int
) -> PoseInCells:
    """The best pose of a lattice around the prior, and of `levels` ever finer ones of 3 x 3 x 3.

    The first lattice spans three standard deviations to either side, in two steps, or in more where two would
    miss what lies between. A pose wins by strictly more than those before it, and the prior comes first:
    without evidence nothing moves.
    """
    half, step = _steps(3.0 * model.position_std, 2.0 * model.spread)
    half_turn, turn = _steps(3.0 * model.heading_std, _TURN)
    ends = _interleaved(ends)
    best, best_value = prior, -np.inf
    for _ in range(levels + 1):
        middle = best
        for k in _from_the_middle(half_turn):
            heading = middle[2] + k * turn
            arms = _arms_in_sight(points, ends, (middle[0], middle[1], heading), half * step)
            for i in _from_the_middle(half):
                for j in _from_the_middle(half):
                    pose = (middle[0] + i * step, middle[1] + j * step, heading)
                    unlikely = _unlikeliness(pose, prior, model)
                    needed = (best_value + unlikely) / model.weight
                    value = model.weight * _score_above(points, arms, pose, model.spread, needed) - unlikely
                    if value > best_value:
                        best_value, best = value, pose
        # The best of a lattice lies at most half a step from the truth in each axis: half a step on.
        step, turn, half, half_turn = 0.5 * step, 0.5 * turn, 1, 1
    return best


@njit(cache=True, nogil=True)
def _from_the_middle(half: int) -> Ints:
    """The steps 0, -1, 1, -2, 2 ... of a lattice: likely poses come first, so that others end early."""
    return np.array([(k + 1) // 2 * (2 * (k % 2 == 0) - 1) for k in range(2 * half + 1)])


@njit(cache=True, nogil=True)
def _interleaved(ends: Floats) -> Floats:
    """The points float64 (n, 2) in an order of which each beginning is spread over all directions."""
    mixed, at = np.empty_like(ends), 0
    for first in (0, 4, 2, 6, 1, 5, 3, 7):
        for i in range(first, len(ends), 8):
            mixed[at] = ends[i]
            at += 1
    return mixed


@njit(cache=True, nogil=True)
def _arms_in_sight(points: MeasuredPoints, ends: Floats, pose: PoseInCells, span: float) -> Floats:
    """The points float64 (n, 2) as seen from a pose, but those with no mean within a span of them."""
    rows, cols = points.around.shape
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    arms, count = np.empty_like(ends), 0
    reach = 3 * math.ceil(span / 3.0)
    for i in range(len(ends)):
        x, y = ends[i, 0] * cos - ends[i, 1] * sin, ends[i, 0] * sin + ends[i, 1] * cos
        arms[count, 0], arms[count, 1] = x, y
        row, col = math.floor(pose[1] + y), math.floor(pose[0] + x)
        # Every third cell tells of the two beside it as well; none on the border has points.
        is_met = False
        for r in range(row - reach, row + reach + 1, 3):
            for c in range(col - reach, col + reach + 1, 3):
                if 0 <= r < rows and 0 <= c < cols:
                    is_met |= points.around[r, c] != 0
        count += is_met
    return arms[:count]


@njit(cache=True, nogil=True)
def _score_above(
    points: MeasuredPoints, arms: Floats, pose: PoseInCells, spread: float, needed: float
) -> float:
    """As `match_score` of points (n, 2) turned already; less, where it cannot be more than is needed."""
    rows, cols = points.number.shape
    x, y, _ = pose
    scale, reach = -0.5 / (spread * spread), (REACH * spread) ** 2
    # A point adds one at most. The sums round: a little less than needed goes on.
    total, needed = 0.0, needed - 1e-9 - len(arms)
    for i in range(len(arms)):
        if total < needed + i:
            break
        end_x, end_y = x + arms[i, 0], y + arms[i, 1]
        if not (1.0 <= end_x < cols - 1 and 1.0 <= end_y < rows - 1):
            continue
        least, row, col = nearest_mean(points, end_x, end_y)
        if least < reach and not is_turned_away(points, row, col, arms[i, 0], arms[i, 1]):
            total += math.exp(least * scale)
    return total


@njit(cache=True, nogil=True)
def _steps(span: float, most: float) -> tuple[int, float]:
    """In how many steps a lattice spans so much to either side, and their length: `most` if few enough do."""
    number = min(max(2, math.ceil(span / most)), _STEPS)
    return number, span / number


@njit(cache=True, nogil=True)
def _unlikeliness(pose: PoseInCells, prior: PoseInCells, model: MatchModel) -> float:
    """Half the squared distance from the prior, in standard deviations; an axis without one does not move."""
    total = 0.0
    if model.position_std > 0.0:
        x, y = pose[0] - prior[0], pose[1] - prior[1]
        total += (x * x + y * y) / (model.position_std * model.position_std)
    if model.heading_std > 0.0:
        turn = (pose[2] - prior[2]) / model.heading_std
        total += turn * turn
    return 0.5 * total
