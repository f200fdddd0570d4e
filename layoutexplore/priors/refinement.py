"""From a rough place of a plan to the best one near it: Gauss-Newton on distances to walls.

A placement maps world points w to points of the plan, p = Q diag(k) R(-theta) (w - c) + b: R turns the
building's walls onto the axes, k scales along them (plan metres a world metre), and the fixed Q turns them by
a multiple of 90 degrees, mirrored or not, onto the walls of the plan. Seen walls are drawn to the plan's
walls, seen floor is driven out of its solid parts; both lose their force when they are far off, as in
iteratively reweighted least squares with the weights of Geman and McClure, 1 / (1 + (r / scale)^2)^2.

References:
    Geman and McClure 1987, "Statistical methods for tomographic image reconstruction".
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from layoutexplore.grids.arrays import Floats, Floats32
from layoutexplore.priors.fields import PlanFields

WALL_STD, OUTLIERS = 0.25, 0.08
"""Metres by which a right plan's walls are off, and the share of seen walls that are in no plan."""

FLOOR_REACH, FLOOR_COST = 0.35, 1.6
"""Seen floor less than so many metres from the plan's walls is doubtful; in the solid it costs so much."""

AGREES = 0.35
"""Metres by which a plan may miss what is seen and still agree with it."""

SILENT, SILENT_SHARE = 1.0, 0.6
"""So many metres inside of the solid a plan is silent rather than wrong: seen floor costs this share."""

FLOOR_WEIGHT = 0.6
"""Weight of a point of floor against one of a wall."""

ASPECT_STD, TURN_STD = 0.05, 0.02
"""Standard deviations of the logarithm of the ratio of both scales, and of the rotation in radians."""


class Placement(NamedTuple):
    """Where a plan lies.

    Attributes:
        turn: float64 (2, 2), Q, orthogonal.
        parameters: float64 (5,): logarithms of the scales along the building's axes, theta, b.
        centre: float64 (2,), c in the world.
    """

    turn: Floats
    parameters: Floats
    centre: Floats


class Fit(NamedTuple):
    """How well a placement explains what is seen.

    Attributes:
        score: Log-likelihood, of points as if they were independent; 0 at best.
        walls: Share of seen walls within `AGREES` of the plan's.
        floor: Share of seen floor that the plan shows as floor.
        outside: Share of seen floor that lies in the plan's solid by more than that.
    """

    score: float
    walls: float
    floor: float
    outside: float


class _Plan(NamedTuple):
    to_walls: Floats32
    depth: Floats32
    cell: float
    low: float


class _Seen(NamedTuple):
    """Points about the placement's centre, what is added to each in the plan; the first `walls` are walls."""

    points: Floats
    shifts: Floats
    walls: int


def matrix_of(placement: Placement) -> tuple[Floats, Floats]:
    """The linear part float64 (2, 2) and the shift float64 (2,) of world -> plan."""
    log_x, log_y, theta, b_x, b_y = placement.parameters.tolist()
    c, s = np.cos(theta), np.sin(theta)
    turned = np.array([[c, s], [-s, c]]) * np.exp([[log_x], [log_y]])
    matrix = placement.turn @ turned
    return matrix, np.array([b_x, b_y]) - matrix @ placement.centre


def recentred(placement: Placement, centre: Floats) -> Placement:
    """The same placement, written about another point of the world."""
    matrix, shift = matrix_of(placement)
    parameters = placement.parameters.copy()
    parameters[3:] = matrix @ centre + shift
    return Placement(placement.turn, parameters, centre)


def refine(
    placement: Placement,
    walls: Floats,
    floor: Floats,
    fields: PlanFields,
    prior: tuple[float, float],
    scales: tuple[float, ...] = (0.8, 0.5, 0.35, 0.35),
    shifts: tuple[Floats, Floats] | None = None,
) -> Placement:
    """The best placement near another one.

    Args:
        placement: Where to begin.
        walls: float64 (n, 2), seen walls in world metres.
        floor: float64 (m, 2), seen floor.
        fields: The plan.
        prior: Direction of the seen walls (radians), and the spread of the scale's logarithm.
        scales: Metres at which a wall's force falls to a quarter, one a round.
        shifts: What local stretching adds in the plan, float64 (n, 2) and (m, 2) in metres.
    """
    plan = _Plan(fields.to_walls, fields.depth, fields.cell, fields.low)
    parameters, added = placement.parameters.copy(), shifts or (np.zeros_like(walls), np.zeros_like(floor))
    points = np.concatenate([walls, floor]) - placement.centre
    seen = _Seen(points, np.concatenate(added), len(walls))
    for scale in scales:
        parameters = _step(parameters, placement.turn, seen, plan, scale, prior)
    return Placement(placement.turn, parameters, placement.centre)


def fit_points(walls: Floats, floor: Floats, fields: PlanFields, unit: float) -> Fit:
    """How well a plan explains points that were mapped into it.

    Args:
        walls: float64 (n, 2), seen walls in plan metres.
        floor: float64 (m, 2), seen floor in plan metres.
        fields: The plan.
        unit: World metres a plan metre.
    """
    plan = _Plan(fields.to_walls, fields.depth, fields.cell, fields.low)
    return Fit(*_fit(walls, floor, plan, unit))


@njit(cache=True, nogil=True)
def sample_field(field: Floats32, x: float, y: float, cell: float, low: float) -> tuple[float, float, float]:
    """Value and gradient of a field at a point of the plan; outside, the value at the edge and no slope."""
    rows, cols = field.shape
    u, v = (x - low) / cell - 0.5, (y - low) / cell - 0.5
    if u < 0 or v < 0 or u >= cols - 1 or v >= rows - 1:
        r, c = min(max(int(v), 0), rows - 1), min(max(int(u), 0), cols - 1)
        return field[r, c], 0.0, 0.0
    c, r = int(u), int(v)
    a, b = u - c, v - r
    f00, f01, f10, f11 = field[r, c], field[r, c + 1], field[r + 1, c], field[r + 1, c + 1]
    value = (1 - b) * ((1 - a) * f00 + a * f01) + b * ((1 - a) * f10 + a * f11)
    gx = ((1 - b) * (f01 - f00) + b * (f11 - f10)) / cell
    gy = ((1 - a) * (f10 - f00) + a * (f11 - f01)) / cell
    return value, gx, gy


@njit(cache=True, nogil=True)
def _step(
    parameters: Floats, turn: Floats, seen: _Seen, plan: _Plan, scale: float, prior: tuple[float, float]
) -> Floats:
    """One step of Gauss-Newton."""
    normal, right = np.zeros((5, 5)), np.zeros(5)
    kx, ky = np.exp(parameters[0]), np.exp(parameters[1])
    c, s = np.cos(parameters[2]), np.sin(parameters[2])
    for n in range(len(seen.points)):
        dx, dy = seen.points[n, 0], seen.points[n, 1]
        # q: along the building's axes, scaled to the plan
        qx, qy = kx * (c * dx + s * dy), ky * (-s * dx + c * dy)
        x = turn[0, 0] * qx + turn[0, 1] * qy + parameters[3] + seen.shifts[n, 0]
        y = turn[1, 0] * qx + turn[1, 1] * qy + parameters[4] + seen.shifts[n, 1]
        if n < seen.walls:
            residual, gx, gy = sample_field(plan.to_walls, x, y, plan.cell, plan.low)
            weight = 1.0 / (WALL_STD * (1 + (residual / scale) ** 2)) ** 2
        else:
            depth, gx, gy = sample_field(plan.depth, x, y, plan.cell, plan.low)
            if depth >= FLOOR_REACH:
                continue
            residual, gx, gy = FLOOR_REACH - depth, -gx, -gy
            weight = FLOOR_WEIGHT / (2 * WALL_STD * (1 + (residual / (2 * scale)) ** 2)) ** 2
        # the residual's derivatives by log kx, log ky, theta and b
        ux, uy = gx * turn[0, 0] + gy * turn[1, 0], gx * turn[0, 1] + gy * turn[1, 1]
        by_theta = ux * kx / ky * qy - uy * ky / kx * qx
        row = np.array([ux * qx, uy * qy, by_theta, gx, gy])
        for i in range(5):
            right[i] -= weight * row[i] * residual
            for j in range(5):
                normal[i, j] += weight * row[i] * row[j]
    _add_prior(normal, right, parameters, prior)
    step = np.linalg.solve(normal, right)
    # Far from the linear range a full step would jump past the place that is looked for.
    limits = np.array([0.06, 0.06, 0.03, 1.0, 1.0])
    moved: Floats = parameters + np.minimum(np.maximum(step, -limits), limits)
    return moved


@njit(cache=True, nogil=True)
def _add_prior(normal: Floats, right: Floats, parameters: Floats, prior: tuple[float, float]) -> None:
    """What is known of scale, aspect and rotation before anything is seen, as further residuals."""
    mean, apart = 1.0 / (2 * prior[1]) ** 2, 1.0 / ASPECT_STD**2
    for i in range(2):
        sign = 1.0 - 2.0 * i
        right[i] -= mean * (parameters[0] + parameters[1]) + sign * apart * (parameters[0] - parameters[1])
        for j in range(2):
            normal[i, j] += mean + (apart if i == j else -apart)
    normal[2, 2] += 1.0 / TURN_STD**2
    right[2] -= (parameters[2] - prior[0]) / TURN_STD**2
    for i in range(3, 5):
        normal[i, i] += 1e-6


@njit(cache=True, nogil=True)
def _fit(walls: Floats, floor: Floats, plan: _Plan, unit: float) -> tuple[float, float, float, float]:
    """Log-likelihood, share of walls explained, of floor explained, and of floor deep in the solid."""
    score, good, shown, solid = 0.0, 0, 0, 0
    for n in range(len(walls)):
        value, _, _ = sample_field(plan.to_walls, walls[n, 0], walls[n, 1], plan.cell, plan.low)
        value *= unit
        score += np.log((1 - OUTLIERS) * np.exp(-0.5 * (value / WALL_STD) ** 2) + OUTLIERS)
        good += value <= AGREES
    for n in range(len(floor)):
        value, _, _ = sample_field(plan.depth, floor[n, 0], floor[n, 1], plan.cell, plan.low)
        value *= unit
        # from the edge of what is doubtful to the face of a wall the cost rises to its whole; far from
        # all that is drawn the plan may only be silent
        cost = min(max((FLOOR_REACH - value) / FLOOR_REACH, 0.0), 1.0)
        score -= FLOOR_WEIGHT * FLOOR_COST * (cost if value > -SILENT else SILENT_SHARE)
        shown += value >= 0.0
        solid += value < -AGREES
    return (score, good / max(len(walls), 1), shown / max(len(floor), 1), solid / max(len(floor), 1))
