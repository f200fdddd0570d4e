"""Local stretching: a smooth field of displacements that draws seen walls onto those of the plan.

The field lives on a lattice over the seen part of the world and beyond, with displacements in plan metres.
Each seen wall says how far it is off along the gradient of the plan's distances; neighbouring nodes want to
be alike, so that the field goes on smoothly where nothing has been seen.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np
from numba import njit
from scipy import linalg

from layoutexplore.grids.arrays import Floats, Floats32
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

    def maps(
        self, low: tuple[float, float], resolution: float, shape: tuple[int, int]
    ) -> tuple[Floats32, Floats32]:
        """Plan x and y float32 (rows, cols) in metres of the centres of cells of a grid without rotation.

        Args:
            low: World (x, y) of the grid's lower left corner.
            resolution: Metres a cell.
            shape: (rows, cols).
        """
        matrix, shift = matrix_of(self.placement)
        x = (low[0] + (np.arange(shape[1]) + 0.5) * resolution).astype(np.float32)
        y = (low[1] + (np.arange(shape[0]) + 0.5) * resolution).astype(np.float32)
        found = [
            np.float32(matrix[k, 1]) * y[:, None] + np.float32(matrix[k, 0]) * x + np.float32(shift[k])
            for k in (0, 1)
        ]
        if self.lattice is not None:
            # Cell (r, c) lies at node coordinates (low + (c + 1/2) resolution - lattice.low) / spacing.
            step = resolution / self.lattice.spacing
            at = (np.array(low) + 0.5 * resolution - self.lattice.low) / self.lattice.spacing
            to_nodes = np.array([[step, 0, at[0]], [0, step, at[1]]], np.float64)
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
    smooth = _smoothness(rows, cols, 1.0 / (STRETCH_STD * spacing) ** 2)
    lattice = Lattice(low, spacing, np.zeros((rows, cols, 2)))
    if placed.lattice is not None:
        nodes = np.stack(np.meshgrid(*(np.arange(n) * spacing for n in (cols, rows))), axis=-1).reshape(-1, 2)
        lattice = lattice._replace(shifts=_at(placed.lattice, nodes + low).reshape(rows, cols, 2))
    for _ in range(rounds):
        normal, right = _equations(walls, linear, lattice.low, spacing, lattice.shifts, _of(fields))
        lattice = lattice._replace(shifts=_solved(normal + smooth, right, rows, cols))
    flat = lattice.shifts.ravel()
    return WarpedPlacement(placed.placement, lattice), 0.5 * float(flat @ smooth @ flat)


def _solved(normal: Floats, right: Floats, rows: int, cols: int) -> Floats:
    """The displacements float64 (rows, cols, 2); renumbered so that neighbours have near numbers."""
    numbers = np.arange(2 * rows * cols).reshape(rows, cols, 2)
    order = (numbers if cols <= rows else numbers.transpose(1, 0, 2)).ravel()
    band = 2 * (min(rows, cols) + 2)
    ordered = normal[np.ix_(order, order)]
    lower = np.zeros((band, len(order)))
    for k in range(band):
        lower[k, : len(order) - k] = np.diagonal(ordered, -k)
    found = np.empty(len(order))
    found[order] = linalg.solveh_banded(lower, right[order], lower=True, check_finite=False)
    return found.reshape(rows, cols, 2)


def _of(fields: PlanFields) -> tuple[Floats32, float, float]:
    return fields.to_walls, fields.cell, fields.low


def _smoothness(rows: int, cols: int, stiffness: float) -> Floats:
    """float64 (2 n, 2 n): what unlike neighbours and large displacements cost."""
    numbers = np.arange(rows * cols).reshape(rows, cols)
    first = np.concatenate([numbers[:-1].ravel(), numbers[:, :-1].ravel()])
    second = np.concatenate([numbers[1:].ravel(), numbers[:, 1:].ravel()])
    found = np.eye(2 * rows * cols) / SHIFT_STD**2
    for axis in (0, 1):
        a, b = 2 * first + axis, 2 * second + axis
        np.add.at(found, (a, a), stiffness)
        np.add.at(found, (b, b), stiffness)
        np.add.at(found, (a, b), -stiffness)
        np.add.at(found, (b, a), -stiffness)
    return found


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
def _equations(
    walls: Floats,
    linear: Floats,
    low: Floats,
    spacing: float,
    shifts: Floats,
    plan: tuple[Floats32, float, float],
) -> tuple[Floats, Floats]:
    """Normal equations of the walls: each is off by its distance, and moves along the gradient of it."""
    rows, cols = shifts.shape[0], shifts.shape[1]
    normal, right = np.zeros((2 * rows * cols, 2 * rows * cols)), np.zeros(2 * rows * cols)
    nodes, parts = np.empty(8, np.int64), np.empty(8)
    moved = _interpolate(low, spacing, shifts, walls)
    for n in range(len(walls)):
        x, y = linear[n, 0] + moved[n, 0], linear[n, 1] + moved[n, 1]
        distance, gx, gy = sample_field(plan[0], x, y, plan[1], plan[2])
        if gx * gx + gy * gy < 0.25:
            continue  # on a ridge between two walls the gradient points nowhere
        weight = WALL_WEIGHT / (WALL_STD * (1 + (distance / FAR) ** 2)) ** 2
        r, c, b, a = _node(low, spacing, (rows, cols), walls[n, 0], walls[n, 1])
        for i in range(2):
            for j in range(2):
                share = (b if i else 1 - b) * (a if j else 1 - a)
                # entries 2m and 2m + 1 are x and y of a corner
                m = 2 * (2 * i + j)
                nodes[m] = 2 * ((r + i) * cols + c + j)
                nodes[m + 1] = nodes[m] + 1
                parts[m], parts[m + 1] = share * gx, share * gy
        # linear in the displacement: distance + g (u - u0), with u0 where it was linearised
        target = gx * moved[n, 0] + gy * moved[n, 1] - distance
        for i in range(8):
            right[nodes[i]] += weight * parts[i] * target
            for j in range(8):
                normal[nodes[i], nodes[j]] += weight * parts[i] * parts[j]
    return normal, right
