"""Local stretching: a smooth field of displacements that draws seen walls onto those of the plan.

The field lives on a lattice over the seen part of the world and beyond, with displacements in plan metres.
Each seen wall says how far it is off along the gradient of the plan's distances; neighbouring nodes want to
be alike, so that the field goes on smoothly where nothing has been seen.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np
import scipy  # its parts are loaded where they are used
from numba import njit

from layoutexplore.grids.arrays import Floats, Floats32
from layoutexplore.grids.grid import Pose
from layoutexplore.priors.fields import PlanFields
from layoutexplore.priors.refinement import Placement, matrix_of, sample_field

SPACING = 6.0
"""Metres between nodes."""

MOST_NODES = 24
"""Nodes along the longer side; on larger floors they lie further apart."""

STRETCH_STD, SHIFT_STD = 0.03, 1.0
"""Standard deviations of the local stretching between nodes, and of a node's displacement in metres."""

WALL_STD, WALL_WEIGHT = 0.2, 0.25
"""Metres by which seen walls are off beside the field, and how many independent points one is worth."""

FAR = 0.6
"""Metres at which a wall's force has fallen to a quarter."""

REACH = 12.0
"""Metres beyond the seen walls that the lattice covers; beyond it the field goes on as at its edge."""


class Lattice(NamedTuple):
    """Displacements at nodes.

    Attributes:
        low: float64 (2,), world (x, y) of node (0, 0).
        spacing: Metres between nodes.
        shifts: float64 (rows, cols, 2), plan metres.
    """

    low: Floats
    spacing: float
    shifts: Floats


@dataclass(frozen=True, eq=False)
class WarpedPlacement:
    """A placement with local stretching.

    Attributes:
        placement: Its linear part.
        lattice: The displacements; None without any.
    """

    placement: Placement
    lattice: Lattice | None = None

    def to_plan(self, points: Floats) -> Floats:
        """Points of the plan float64 (n, 2) in metres of world points (n, 2)."""
        matrix, shift = matrix_of(self.placement)
        linear = points @ matrix.T + shift
        return np.asarray(linear + self.shifts(points))

    def shifts(self, points: Floats) -> Floats:
        """What the stretching adds in the plan, float64 (n, 2) in metres, at world points (n, 2)."""
        return (
            np.zeros_like(points) if self.lattice is None else _at(self.lattice, np.ascontiguousarray(points))
        )

    def to_world(self, points: Floats) -> Floats:
        """World points float64 (n, 2) of points of the plan (n, 2) in metres."""
        matrix, shift = matrix_of(self.placement)
        back = np.linalg.inv(matrix).T
        found = (points - shift) @ back
        for _ in range(4 if self.lattice is not None else 0):  # a field this smooth is far from folding
            found = (points - shift - self.shifts(found)) @ back
        return np.asarray(found)

    def maps(self, origin: Pose, resolution: float, shape: tuple[int, int]) -> tuple[Floats32, Floats32]:
        """Plan x and y float32 (rows, cols) in metres of the centres of a grid's cells.

        Args:
            origin: The grid's lower left corner in the world, and how it is turned.
            resolution: Metres a cell.
            shape: (rows, cols).
        """
        matrix, shift = matrix_of(self.placement)
        low, c, s = np.array(origin[:2]), math.cos(origin.theta), math.sin(origin.theta)
        turned = np.array([[c, -s], [s, c]])
        # From the corner on: world coordinates of a country's grid are too large for single precision.
        x, y = (((np.arange(n) + 0.5) * resolution).astype(np.float32) for n in shape[::-1])
        corner = (matrix @ low + shift).astype(np.float32)
        matrix = matrix @ turned
        found = [
            np.float32(matrix[k, 1]) * y[:, None] + np.float32(matrix[k, 0]) * x + corner[k] for k in (0, 1)
        ]
        if self.lattice is not None:
            # Cell (r, c) lies at node coordinates (low + turned (c + 1/2, r + 1/2) resolution - lattice.low)
            # / spacing.
            step = turned * (resolution / self.lattice.spacing)
            at = (low + turned.sum(axis=1) * 0.5 * resolution - self.lattice.low) / self.lattice.spacing
            to_nodes = np.column_stack([step, at])
            flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
            drawn = cv2.warpAffine(
                self.lattice.shifts.astype(np.float32),
                to_nodes,
                shape[::-1],
                flags=flags,
                borderMode=cv2.BORDER_REPLICATE,
            )
            found = [found[k] + drawn[..., k] for k in (0, 1)]
        return found[0], found[1]


def bent(
    placed: WarpedPlacement, walls: Floats, fields: PlanFields, rounds: int
) -> tuple[WarpedPlacement, float]:
    """The placement with the stretching that explains seen walls best, and its cost in log-likelihood.

    Args:
        placed: The linear part, refined; its lattice is where the stretching begins.
        walls: float64 (n, 2), seen walls in world metres.
        fields: The plan.
        rounds: How often distances are linearised.
    """
    low, high = walls.min(axis=0) - REACH, walls.max(axis=0) + REACH
    spacing = max(SPACING, float((high - low).max()) / (MOST_NODES - 1))
    cols, rows = (np.ceil((high - low) / spacing).astype(int) + 1).tolist()
    matrix, shift = matrix_of(placed.placement)
    linear = walls @ matrix.T + shift
    stiffness = 1.0 / (STRETCH_STD * spacing) ** 2
    lattice = Lattice(low, spacing, np.zeros((rows, cols, 2)))
    if placed.lattice is not None:
        nodes = np.stack(np.meshgrid(*(np.arange(n) * spacing for n in (cols, rows))), axis=-1).reshape(-1, 2)
        lattice = lattice._replace(shifts=_at(placed.lattice, nodes + low).reshape(rows, cols, 2))
    for _ in range(rounds):
        lower, right = _smoothness(rows, cols, stiffness)
        _add_walls(lower, right, walls, linear, lattice, _of(fields))
        found = scipy.linalg.solveh_banded(lower, right, overwrite_ab=True, lower=True, check_finite=False)
        lattice = lattice._replace(shifts=_by_place(found, rows, cols))
    return WarpedPlacement(placed.placement, lattice), _cost(lattice.shifts, stiffness)


def _by_place(found: Floats, rows: int, cols: int) -> Floats:
    """Displacements float64 (rows, cols, 2) of unknowns in their order, see `_unknown`."""
    if cols <= rows:
        return found.reshape(rows, cols, 2)
    return np.ascontiguousarray(found.reshape(cols, rows, 2).transpose(1, 0, 2))


def _cost(shifts: Floats, stiffness: float) -> float:
    """What unlike neighbours and large displacements cost in log-likelihood."""
    unlike = sum(float(np.square(np.diff(shifts, axis=axis)).sum()) for axis in (0, 1))
    return 0.5 * (stiffness * unlike + float(np.square(shifts).sum()) / SHIFT_STD**2)


def _of(fields: PlanFields) -> tuple[Floats32, float, float]:
    return fields.to_walls, fields.cell, fields.low


@njit(cache=True, nogil=True)
def _unknown(row: int, col: int, rows: int, cols: int) -> int:
    """The number of a node's first unknown: along the shorter side first, so that neighbours are near."""
    return 2 * (row * cols + col if cols <= rows else col * rows + row)


@njit(cache=True, nogil=True)
def _smoothness(rows: int, cols: int, stiffness: float) -> tuple[Floats, Floats]:
    """Banded normal equations, lower[k, j] being row j + k of column j, of the costs of a displacement."""
    band = 2 * (min(rows, cols) + 2)
    lower, right = np.zeros((band, 2 * rows * cols)), np.zeros(2 * rows * cols)
    lower[0] = 1.0 / SHIFT_STD**2
    for r in range(rows):
        for c in range(cols):
            node = _unknown(r, c, rows, cols)
            for i, j in ((r + 1, c), (r, c + 1)):
                if i == rows or j == cols:
                    continue
                other = _unknown(i, j, rows, cols)  # always the higher one: either order counts upwards
                for axis in range(2):
                    lower[0, node + axis] += stiffness
                    lower[0, other + axis] += stiffness
                    lower[other - node, node + axis] -= stiffness
    return lower, right


def _at(lattice: Lattice, points: Floats) -> Floats:
    return _interpolate(lattice.low, lattice.spacing, lattice.shifts, points)


@njit(cache=True, nogil=True)
def _node(
    low: Floats, spacing: float, shape: tuple[int, int], x: float, y: float
) -> tuple[int, int, float, float]:
    """The node below and left of a point and how far beyond it lies; outside, the nearest edge."""
    u = min(max((x - low[0]) / spacing, 0.0), shape[1] - 1.000001)
    v = min(max((y - low[1]) / spacing, 0.0), shape[0] - 1.000001)
    return int(v), int(u), v - int(v), u - int(u)


@njit(cache=True, nogil=True)
def _interpolate(low: Floats, spacing: float, shifts: Floats, points: Floats) -> Floats:
    """Displacements float64 (n, 2) at points."""
    found = np.empty((len(points), 2))
    shape = (shifts.shape[0], shifts.shape[1])
    for n in range(len(points)):
        r, c, b, a = _node(low, spacing, shape, points[n, 0], points[n, 1])
        for k in range(2):
            found[n, k] = (1 - b) * ((1 - a) * shifts[r, c, k] + a * shifts[r, c + 1, k]) + b * (
                (1 - a) * shifts[r + 1, c, k] + a * shifts[r + 1, c + 1, k]
            )
    return found


@njit(cache=True, nogil=True)
def _add_walls(
    lower: Floats,
    right: Floats,
    walls: Floats,
    linear: Floats,
    lattice: Lattice,
    plan: tuple[Floats32, float, float],
) -> None:
    """Add the walls' equations: each is off by its distance, and moves along the gradient of it."""
    rows, cols = lattice.shifts.shape[0], lattice.shifts.shape[1]
    nodes, parts = np.empty(8, np.int64), np.empty(8)
    moved = _interpolate(lattice.low, lattice.spacing, lattice.shifts, walls)
    for n in range(len(walls)):
        x, y = linear[n, 0] + moved[n, 0], linear[n, 1] + moved[n, 1]
        distance, gx, gy = sample_field(plan[0], x, y, plan[1], plan[2])
        if gx * gx + gy * gy < 0.25:
            continue  # on a ridge between two walls the gradient points nowhere
        weight = WALL_WEIGHT / (WALL_STD * (1 + (distance / FAR) ** 2)) ** 2
        r, c, b, a = _node(lattice.low, lattice.spacing, (rows, cols), walls[n, 0], walls[n, 1])
        for i in range(2):
            for j in range(2):
                share = (b if i else 1 - b) * (a if j else 1 - a)
                # entries 2m and 2m + 1 are x and y of a corner
                m = 2 * (2 * i + j)
                nodes[m] = _unknown(r + i, c + j, rows, cols)
                nodes[m + 1] = nodes[m] + 1
                parts[m], parts[m + 1] = share * gx, share * gy
        # linear in the displacement: distance + g (u - u0), with u0 where it was linearised
        target = gx * moved[n, 0] + gy * moved[n, 1] - distance
        for i in range(8):
            right[nodes[i]] += weight * parts[i] * target
            for j in range(8):
                if nodes[j] <= nodes[i]:  # the upper half is the same
                    lower[nodes[i] - nodes[j], nodes[j]] += weight * parts[i] * parts[j]
