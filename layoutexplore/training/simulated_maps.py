"""Grid maps with known rooms: floor plans, furnished at random, seen whole or while being explored."""

from __future__ import annotations

import cv2
import numpy as np

from layoutexplore.grids.arrays import Bytes, Cells, Ints32, Mask
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN, Cell, Pose, in_cells
from layoutexplore.grids.morphology import inflate, with_neighbours
from layoutexplore.maps.floorplan import FloorPlan, PlanRaster
from layoutexplore.planning.shortest_paths import geodesic_distances
from layoutexplore.sensing.lidar import Lidar, LidarConfig
from layoutexplore.sensing.mapper import Mapper
from layoutexplore.training.merging_examples import SIMULATED, Example, make_example
from layoutexplore.training.polygonal_buildings.drawn_furniture import draw_furniture

RESOLUTION = 0.05
LARGEST = 7500.0
"""Square metres of a raster above which a plan is left out: it would count and take as much as ten others."""

DENSITIES = (0.0, 0.05, 0.15, 0.3)
"""Pieces of furniture a square metre, one of them for each map."""

RANGES, BEAMS = (8.0, 15.0, 30.0), (360, 720, 1080)
NOISES, POSE_ERRORS = (0.01, 0.03, 0.05), (0.0, 0.02, 0.04)
STOPS, NEIGHBOURHOODS = (6, 15, 40), (10, 25, 60, 150, 400)
"""Scans a map, and how many of 600 random places, the nearest to the start, they are spread over."""


def generated_plan(k: int, seed: int) -> FloorPlan:
    """A generated floor plan, the k-th that belongs to a seed: of all families in turn."""
    from layoutexplore.maps.generator import FAMILIES, generate

    families = sorted(FAMILIES)
    return generate(families[k % len(families)], 1000 * seed + k)


def furnish_cells(
    occupied: Mask, rooms: Ints32, density: float, resolution: float, rng: np.random.Generator
) -> Mask:
    """Add furniture: columns, cupboards, tables on four legs, rotated boxes; none reaches through a wall.

    The furniture of generated plans (`layoutexplore.maps.generator.furniture`) stands as people place it;
    this one stands anywhere, also where no plan but only a grid is at hand, and is drawn with the walls of a
    scan.

    Args:
        occupied: bool (rows, cols).
        rooms: int32 (rows, cols), room of each cell, 0 for none.
        density: Pieces a square metre.
        resolution: Metres a cell.
        rng: Source of randomness.
    """
    out, floor = occupied.copy(), np.argwhere(rooms > 0)
    for _ in range(int(len(floor) * resolution**2 * density)):
        row, col = (int(v) for v in floor[rng.integers(len(floor))])
        reach = in_cells(2.2, resolution)
        part = np.s_[max(row - reach, 0) : row + reach, max(col - reach, 0) : col + reach]
        here = rooms[part] == rooms[row, col]
        place = Cell(row - part[0].start, col - part[1].start)
        out[part] |= (_furniture(here.shape, place, resolution, rng) > 0) & here
    return out


def _furniture(shape: tuple[int, ...], place: Cell, resolution: float, rng: np.random.Generator) -> Bytes:
    """One thing at a place: not 0 where it stands."""

    def cells_of(metres: float) -> int:
        return in_cells(metres, resolution)

    (row, col), one, two = place, cells_of(0.05), cells_of(0.1)
    canvas, kind = np.zeros(shape, np.uint8), rng.integers(4)
    if kind == 0:
        cv2.circle(canvas, (col, row), int(rng.integers(one, cells_of(0.25))), 1, cv2.FILLED)
    elif kind == 1:
        w, h = (int(v) for v in rng.integers(cells_of(0.3), cells_of(1.8), 2))
        canvas[row : row + h, col : col + w] = 1
        if rng.random() < 0.5:
            canvas[row + one : row + h - one, col + one : col + w - one] = 0
    elif kind == 2:
        w, h = (int(v) for v in rng.integers(cells_of(0.5), cells_of(1.8), 2))
        for down, along in ((0, 0), (0, w), (h, 0), (h, w)):
            canvas[row + down : row + down + two, col + along : col + along + two] = 1
    else:
        sides = ((0.4, 2.0), (0.2, 0.8))
        size = tuple(float(rng.uniform(cells_of(low), cells_of(high))) for low, high in sides)
        corners = cv2.boxPoints(((float(col), float(row)), size, float(rng.uniform(0, 180))))
        cv2.fillPoly(canvas, [np.rint(corners).astype(np.int32)], 1)
    return canvas


def drawn(occupied: Mask) -> Cells:
    """The map of a building as it is drawn: all of it, without noise, unknown inside what is solid."""
    near = with_neighbours(~occupied)
    return np.where(~occupied, FREE, np.where(near, OCCUPIED, UNKNOWN)).astype(np.int8)


def see(occupied: Mask, origin: Pose, rng: np.random.Generator) -> Cells | None:
    """The map of a building: whole, partly explored, or so with a noisy lidar; None where no robot fits."""
    kind = str(rng.choice(["whole", "explored", "explored", "noisy", "noisy"]))
    if kind == "whole":
        return drawn(occupied)
    noise = float(rng.choice(NOISES)) if kind == "noisy" else 0.0
    sensor = LidarConfig(
        range_max=float(rng.choice(RANGES)),
        fov=2 * np.pi,
        beams=int(rng.choice(BEAMS)),
        range_noise_std=noise,
    )
    lidar, mapper = Lidar(sensor, occupied, RESOLUTION, origin), Mapper(occupied.shape, RESOLUTION, origin)
    # doorways too, which belong to no room: a robot that may not stand in them sees one room only
    for cell in choose_stops(~inflate(occupied, 0.15, RESOLUTION), RESOLUTION, rng):
        x, y = mapper.grid.cell_to_world(*cell)
        pose = Pose(x, y, float(rng.uniform(0, 2 * np.pi)))
        if kind == "explored":
            mapper.observe(lidar, pose)
            continue
        dx, dy, turn = rng.normal(size=3) * float(rng.choice(POSE_ERRORS))
        mapper.integrate(Pose(x + dx, y + dy, pose.theta + 0.1 * turn), lidar.scan(pose, rng), sensor)
    return mapper.grid.cells.copy() if (mapper.grid.cells == FREE).any() else None


def choose_stops(allowed: Mask, resolution: float, rng: np.random.Generator) -> list[tuple[int, int]]:
    """Places to scan from, spread around a random start; none where there is hardly any space.

    Args:
        allowed: bool (rows, cols), where the robot may be.
        resolution: Metres a cell.
        rng: Source of randomness.
    """
    places = np.argwhere(allowed)
    if len(places) < round(0.25 / resolution**2):
        return []
    start = places[rng.integers(len(places))]
    away = geodesic_distances(allowed, Cell(int(start[0]), int(start[1])), resolution)
    some = places[rng.permutation(len(places))[:600]]
    distances = away[some[:, 0], some[:, 1]]
    some = some[np.argsort(distances, kind="stable")][: int(np.isfinite(distances).sum())]
    some = some[: int(rng.choice(NEIGHBOURHOODS))]
    return [(int(r), int(c)) for r, c in some[:: max(len(some) // int(rng.choice(STOPS)), 1)]]


def scanned_cells(raster: PlanRaster, rng: np.random.Generator) -> Cells | None:
    """A floor plan as a lidar sees it, furnished or not, int8 (rows, cols); None where no robot fits in."""
    density = float(rng.choice(DENSITIES))
    occupied = (
        furnish_cells(raster.occupied, raster.room_ids, density, RESOLUTION, rng)
        if density
        else raster.occupied
    )
    return see(occupied, raster.origin, rng)


def drawn_cells(plan: FloorPlan, raster: PlanRaster, rng: np.random.Generator) -> Cells:
    """A whole floor plan as it is drawn, two in three with furniture, int8 (rows, cols)."""
    return drawn(draw_furniture(plan, raster, rng) if rng.random() < 2 / 3 else raster.occupied)


def simulated_example(plan: FloorPlan, rng: np.random.Generator) -> Example | None:
    """A map of a floor plan as something to learn from; None for a plan too large or too small."""
    raster = plan.rasterize(RESOLUTION)
    if raster.room_ids.size > round(LARGEST / RESOLUTION**2):
        return None
    cells = scanned_cells(raster, rng)
    if cells is None:
        return None
    return make_example(cells, raster.room_ids, RESOLUTION, building=SIMULATED, kind=plan.name)


def drawn_example(plan: FloorPlan, rng: np.random.Generator) -> Example:
    """A map of a whole floor plan as it is drawn, as something to learn from."""
    raster = plan.rasterize(RESOLUTION)
    cells = drawn_cells(plan, raster, rng)
    return make_example(cells, raster.room_ids, RESOLUTION, building=SIMULATED, kind=plan.name)
