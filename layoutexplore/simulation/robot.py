"""The robot's body: where it may start, how it moves, and what stops it.

Its disc is tested against the very cells that the lidar sees: the centre may enter a cell when no occupied
cell's centre is closer than the robot's radius. With odometry noise the robot believes it is elsewhere than
it is, and since its map is built from the believed pose, the map bends, as it does in SLAM without loop
closure.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from layoutexplore.errors import ConfigError, StartError, checks_arguments, checks_making, shortened
from layoutexplore.grids.arrays import Floats, Ints32, Mask, check_alike
from layoutexplore.grids.grid import Pose
from layoutexplore.grids.morphology import disc_offsets
from layoutexplore.maps.floorplan import PlanRaster
from layoutexplore.options import POSE


@dataclass(frozen=True, kw_only=True)
class OdometryNoise:
    """Drift of the believed pose, as standard deviations over one metre walked.

    Attributes:
        translation: Error of the length, in metres per metre.
        rotation: Error of the heading, in radians per metre.
    """

    translation: float = 0.0
    rotation: float = 0.0


PERFECT_ODOMETRY = OdometryNoise()

BACK = 0.15
"""Metres that a robot which drifts backs up from a wall that has stopped it."""


class Motion(NamedTuple):
    """What a motion primitive did: metres moved, whether a wall stopped it, and cells newly known."""

    moved: float
    collided: bool
    new_cells: int


@checks_arguments
def draw_start(
    raster: PlanRaster, robot_radius: float, rng: np.random.Generator, region: Mask | None = None
) -> Pose:
    """A random heading at the centre of a random reachable cell of the plan's largest connected area.

    Args:
        raster: The floor plan.
        robot_radius: In metres.
        rng: Decides.
        region: bool (rows, cols), where the cell has to lie; anywhere when None.

    Raises:
        StartError: The robot fits nowhere in the region.
    """
    reachable = raster.reachable(robot_radius)
    if region is not None:
        check_alike("draw_start", reachable=reachable, region=region)
    cells = reachable if region is None else reachable & region
    in_rows = np.cumsum(np.count_nonzero(cells, axis=1))
    if in_rows[-1] == 0:
        raise StartError("the robot fits nowhere in the region: it is too small or not in the building")
    number = int(rng.integers(in_rows[-1]))  # of the cells in raster order
    row = int(np.searchsorted(in_rows, number, side="right"))
    col = int(np.flatnonzero(cells[row])[number - in_rows[row]])
    x, y = raster.cell_to_world(row, col)
    return Pose(x, y, float(rng.uniform(-math.pi, math.pi)))


def check_start(raster: PlanRaster, robot_radius: float, start: Pose, region: Mask | None = None) -> Pose:
    """The start, if the robot's disc fits there, and it lies in the region bool (rows, cols), if any.

    Raises:
        StartError: It lies outside, in a wall, or closer to an obstacle than the robot's radius (the message
            names the nearest cell of the region where it fits), or outside of the region.
    """
    if not _is_pose(start):
        raise StartError(f"a start is three finite numbers (x, y, theta), got {shortened(start)}")
    x, y, theta = (float(v) for v in start)
    cell = raster.world_to_cell(x, y)
    fits = ~raster.blocked(robot_radius)
    free, hint = np.argwhere(fits if region is None else fits & region), ""
    if len(free):
        row, col = free[np.argmin(((free - np.array(cell)) ** 2).sum(axis=1))].tolist()
        near_x, near_y = raster.cell_to_world(row, col)
        hint = f"; the nearest free place is ({near_x:.2f}, {near_y:.2f})"
    rows, cols = raster.shape
    if not (0 <= cell.row < rows and 0 <= cell.col < cols):
        raise StartError(f"the start ({x:.2f}, {y:.2f}) lies outside the floor plan{hint}")
    if raster.occupied[cell]:
        raise StartError(f"the start ({x:.2f}, {y:.2f}) lies in a wall or outside the building{hint}")
    if raster.blocked(robot_radius)[cell]:
        raise StartError(f"the start ({x:.2f}, {y:.2f}) is closer than {robot_radius} m to an obstacle{hint}")
    if region is not None and not region[cell]:
        raise StartError(f"the start ({x:.2f}, {y:.2f}) lies outside of the region that is explored{hint}")
    return Pose(x, y, math.remainder(theta, 2 * math.pi))


def _is_pose(value: Any) -> bool:
    """Whether it is three finite numbers, none of them too large to be a place."""
    try:
        POSE.convert("start", value.tolist() if isinstance(value, np.ndarray) else value)
    except ConfigError:
        return False
    return True


class Floor(NamedTuple):
    """Where the robot's centre may not be, and where the cells lie; numba kernels take it as it is.

    Attributes:
        blocked: bool (rows, cols), cells where the centre may not be.
        x: Of the lower left corner of cell (0, 0), in metres.
        y: Of the same corner.
        resolution: Metres per cell.
    """

    blocked: Mask
    x: float
    y: float
    resolution: float


class _Track:
    """Poses in an array that grows."""

    def __init__(self, start: Pose) -> None:
        self._rows = np.empty((256, 3))
        self._count = 0
        self.add(start)

    @property
    def poses(self) -> Floats:
        """float64 (n, 3), as (x, y, theta); a view to read, to which nothing is added later."""
        view = self._rows[: self._count]
        view.flags.writeable = False
        return view

    def replace_last(self, pose: Pose) -> None:
        """Another pose instead of the last one."""
        self._count -= 1
        self.add(pose)

    def add(self, poses: Pose | Floats) -> None:
        """One pose, of which drift may have turned the heading beyond pi, or float64 (n, 3)."""
        if isinstance(poses, Pose):
            poses = poses._replace(theta=math.remainder(poses.theta, 2 * math.pi))
        rows = np.asarray(poses, np.float64).reshape(-1, 3)
        end = self._count + len(rows)
        if end > len(self._rows):
            self._rows = np.concatenate([self.poses, np.empty((2 * end - self._count, 3))])
        self._rows[self._count : end] = rows
        self._count = end


@checks_making
class Robot:
    """A disc that turns and translates on a floor plan.

    Attributes:
        pose: Where it is.
        believed: Where it believes it is; the same without odometry noise.
        walked: Metres walked.
        turned: Radians turned.
        collisions: How often a wall stopped it.
        floor: What it drives on.
    """

    def __init__(
        self, raster: PlanRaster, radius: float, start: Pose, noise: OdometryNoise, rng: np.random.Generator
    ) -> None:
        self.pose = self.believed = start
        self.walked = self.turned = 0.0
        self.collisions = 0
        self._track = _Track(start)
        self._raster, self._radius, self._noise, self._rng = raster, radius, noise, rng
        x, y, _ = raster.origin
        self.floor = Floor(raster.blocked(radius), float(x), float(y), float(raster.resolution))
        self._drifts = noise.translation > 0 or noise.rotation > 0
        self._believed_track = _Track(start) if self._drifts else self._track

    @property
    def track(self) -> Floats:
        """float64 (n, 3): the true poses so far, as (x, y, theta), theta from -pi to pi."""
        return self._track.poses

    @property
    def believed_track(self) -> Floats:
        """float64 (n, 3): where it believed to be at each of them."""
        return self._believed_track.poses

    def turn_to(self, theta: float) -> None:
        """Turn on the spot to a believed heading, the short way round."""
        turn = math.remainder(theta - self.believed.theta, 2 * math.pi)
        offset = self.pose.theta - self.believed.theta
        heading = math.remainder(theta, 2 * math.pi)
        self.turned += abs(turn)
        self.believed = self.believed._replace(theta=heading)
        self.pose = self.pose._replace(theta=math.remainder(heading + offset, 2 * math.pi))

    def turn_around(self) -> None:
        """Turn on the spot all the way round."""
        self.turned += 2 * math.pi

    def translate(self, dx: float, dy: float) -> tuple[float, bool]:
        """Move straight by (dx, dy) metres as believed, without turning, as far as the walls allow.

        Returns:
            Metres moved, and whether a wall stopped the robot.
        """
        length = math.hypot(dx, dy)
        if length == 0.0:
            return 0.0, False
        true_dx, true_dy, drift = self._drifted(dx, dy, length) if self._drifts else (dx, dy, 0.0)
        blocked, origin_x, origin_y, resolution = self.floor
        share = _free_share(
            blocked,
            (self.pose.y - origin_y) / resolution,
            (self.pose.x - origin_x) / resolution,
            true_dy / resolution,
            true_dx / resolution,
        )
        self.believed = Pose(self.believed.x + share * dx, self.believed.y + share * dy, self.believed.theta)
        # Errors of the heading add up as a random walk: of a share of the way, its root.
        theta = self.pose.theta + math.sqrt(share) * drift
        self.pose = Pose(self.pose.x + share * true_dx, self.pose.y + share * true_dy, theta)
        self.walked += share * length
        self._track.add(self.pose)
        if self._drifts:
            self._believed_track.add(self.believed)
        collided = share < 1.0
        self.collisions += collided
        return share * length, collided

    def back_up(self) -> None:
        """Leave a wall that has stopped it the way it came, as it believes; not without odometry noise.

        A robot that drifts and stands against a wall touches it again wherever it goes.
        """
        end = self.walked + BACK
        for x, y, _ in self.believed_track[-2::-1].tolist() if self._drifts else ():
            _, collided = self.translate(x - self.believed.x, y - self.believed.y)
            if collided or self.walked >= end:
                return

    def arrive(self, track: Floats, pose: Pose, walked: float, turned: float) -> None:
        """Be where a path has led (see `layoutexplore.simulation.path_following`), without odometry noise.

        Args:
            track: float64 (n, 3), the poses passed as (x, y, theta).
            pose: The last one, after turning.
            walked: Metres walked in all.
            turned: Radians turned in all.
        """
        self._track.add(track)
        self.pose = self.believed = pose
        self.walked, self.turned = walked, turned

    def relocate(self, believed: Pose) -> None:
        """Believe to be elsewhere, as a scan matched with the map tells."""
        self.believed = believed
        self._believed_track.replace_last(believed)

    def touched(self, dx: float, dy: float) -> Ints32:
        """Cells int32 (n, 2) of the walls ahead of the robot in direction (dx, dy), in the believed frame."""
        raster = self._raster
        offset = self.pose.theta - self.believed.theta
        angle = math.atan2(dy, dx) + offset
        here = raster.world_to_cell(self.pose.x, self.pose.y)
        ahead = raster.world_to_cell(
            self.pose.x + raster.resolution * math.cos(angle),
            self.pose.y + raster.resolution * math.sin(angle),
        )
        disc = np.array(ahead, np.int32) + disc_offsets(self._radius / raster.resolution)
        disc = disc[((disc >= 0) & (disc < np.array(raster.shape))).all(axis=1)]
        walls = disc[raster.occupied[disc[:, 0], disc[:, 1]]]
        # as (row, col) from the robot, turned to where it believes that they lie
        c, s = math.cos(offset), math.sin(offset)
        away = np.rint((walls - np.array(here)) @ np.array([[c, s], [-s, c]])).astype(np.int32)
        return np.asarray(away + np.array(raster.world_to_cell(self.believed.x, self.believed.y)), np.int32)

    def _drifted(self, dx: float, dy: float, length: float) -> tuple[float, float, float]:
        """The true displacement for a believed one, and the drift of the heading."""
        drift = float(self._rng.normal(0.0, self._noise.rotation * math.sqrt(length)))
        scale = max(0.0, 1.0 + float(self._rng.normal(0.0, self._noise.translation / math.sqrt(length))))
        turn = self.pose.theta - self.believed.theta + drift
        c, s = scale * math.cos(turn), scale * math.sin(turn)
        return c * dx - s * dy, s * dx + c * dy, drift


@njit(cache=True, nogil=True)
def _free_share(blocked: Mask, row: float, col: float, d_row: float, d_col: float) -> float:
    """The share 0..1 of a straight move (in cells) that is not blocked; samples lie 1/20 cell apart.

    A move that changes row and column between two samples needs both cells beside the diagonal to be free as
    well. Samples look a hair ahead and a stop keeps one sample's distance, so that rounding never puts the
    robot over a border.
    """
    rows, cols = blocked.shape
    samples = max(1, math.ceil(20.0 * math.hypot(d_row, d_col)))
    r, c = math.floor(row), math.floor(col)
    for k in range(1, samples + 1):
        t = k / samples + 1e-6
        next_r, next_c = math.floor(row + d_row * t), math.floor(col + d_col * t)
        if next_r != r or next_c != c:
            if next_r < 0 or next_c < 0 or next_r >= rows or next_c >= cols or blocked[next_r, next_c]:
                return max(0, k - 2) / samples
            if next_r != r and next_c != c and (blocked[r, next_c] or blocked[next_r, c]):
                return max(0, k - 2) / samples
            r, c = next_r, next_c
    return 1.0


@njit(cache=True, nogil=True)
def advance_along(
    floor: Floor, x: float, y: float, points: Floats, walked: float, pause: float, end: float, reached: Floats
) -> tuple[int, float]:
    """Go straight from (x, y) to point after point, as long as nothing happens; only without odometry noise.

    The robot stops at a point when `pause` metres or more have been walked since the call, and at the point
    before one that a wall would keep it from, or at which it would have walked `end` metres or more in its
    life: those steps are for `Robot.translate`.

    Args:
        floor: What it drives on.
        x: Where it is, in metres.
        y: Where it is, in metres.
        points: float64 (n, 2), (x, y) in metres.
        walked: Metres walked in all so far.
        pause: Metres.
        end: Metres.
        reached: float64 (n, 3), the first two columns take the points that are reached.

    Returns:
        How many points are reached, and the metres walked then.
    """
    begun = walked
    for k in range(len(points)):
        # Differences are added up as `Robot.translate` adds them: the same rounding, to the bit.
        dx, dy = points[k, 0] - x, points[k, 1] - y
        length = math.hypot(dx, dy)
        if walked + length >= end:
            return k, walked
        row, col = (y - floor.y) / floor.resolution, (x - floor.x) / floor.resolution
        if _free_share(floor.blocked, row, col, dy / floor.resolution, dx / floor.resolution) < 1.0:
            return k, walked
        x, y = x + dx, y + dy
        reached[k, 0], reached[k, 1] = x, y
        walked += length
        if walked - begun >= pause:
            return k + 1, walked
    return len(points), walked
