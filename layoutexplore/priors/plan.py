"""Prior plans: what somebody knew of a building before the robot came, at a scale and place unknown.

A `PriorPlan` is a drawing as cells: which are floor, and which room each belongs to. Its frame is its own:
metres by the scale that is believed, x right, y up, (0, 0) at the lower left corner of cell (0, 0). Where it
lies in the world, `layoutexplore.priors.registration` finds out.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np
import shapely
from shapely import Polygon

from layoutexplore.errors import ConfigError, MapError, checks_arguments, checks_calls
from layoutexplore.grids.arrays import Floats, Ints32, Mask, shows_shapes
from layoutexplore.grids.morphology import draw_way, nearest_cells
from layoutexplore.maps.floorplan import FloorPlan, Room
from layoutexplore.maps.raster import PlanRaster
from layoutexplore.maps.sizes import check_ids
from layoutexplore.maps.tracing import trace_doors
from layoutexplore.options import SHARE, Rule, check, check_kind

RESOLUTION = 0.1
"""Metres a cell of plans that are polygons."""

KNOWN_SPREAD, HINTED_SPREAD, UNKNOWN_SPREAD = 0.04, 0.03, 0.25
"""Standard deviations of the logarithm of a scale: of a plan in metres, of one that is told, of none."""

DOOR_WIDTH, DOOR_SPREAD = 0.85, 0.23
"""Metres of a usual door, and the standard deviation of the logarithm of a plan's median."""

LEAST_DOOR_SHARE = 0.06
"""Openings narrower than this share of a room's side are places where slanted rooms touch, no doors."""

ROOM_SIDE, ROOM_SPREAD = 4.5, 0.45
"""Metres of the side of a usual room (the root of a plan's median area), and that of its logarithm."""

OTHER_UNIT, LEAST_DOORS, ROOMS_ALONE = 2.2, 3, 6.0
"""A plan is in another unit than metres where its doors and its rooms are so many times too large or small;
where fewer doors than that are found, its rooms so many times too large."""

LEAST_ROOMS, LEAST_AREA = 2, 20.0
"""Rooms, and square metres at the believed scale, that a plan has at least to be of use."""

LONGEST = 2000.0
"""Metres at the believed scale; no plan of a building is longer."""

CUT_OFF_AREA = (2.0, 150.0)
"""Square metres of a room for which a door is assumed: smaller ones are specks, larger ones courtyards."""

WALL_REACH = 0.8
"""Metres; rooms this near to each other have a wall in common."""


@dataclass(frozen=True, kw_only=True)
class PriorHints:
    """What is told about a prior plan; None where nothing is.

    Attributes:
        scale: What one metre of the plan is in the world, or one pixel of a picture; metres.
        rotation: Degrees counter-clockwise by which the plan is turned into the map, within 45 degrees; of a
            mirrored plan, after its left and right are exchanged.
        mirror: Whether the plan is drawn as in a mirror.
        here: Point (x, y) of the plan, in its metres or pixels from the lower left, where the robot starts.

    Raises:
        ConfigError: A value makes no sense.
    """

    scale: float | None = None
    rotation: float | None = None
    mirror: bool | None = None
    here: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        check(
            self,
            "hint ",
            scale=Rule(above=0.0, high=1e4, optional=True),
            rotation=Rule(low=-360.0, high=360.0, optional=True),
            mirror=Rule(kind=bool, optional=True),
            here=Rule(count=2, optional=True),
        )


@checks_calls
@shows_shapes
@dataclass(frozen=True, eq=False, kw_only=True)
class PriorPlan:
    """A plan of a building in a frame of its own.

    Attributes:
        name: What it is called in messages.
        free: bool (rows, cols), floor; row 0 has the lowest y.
        room_ids: int32 (rows, cols), the room of each cell, 0 for none (walls, doors, the outside).
        resolution: Metres a cell, by the scale that is believed.
        scale_spread: Standard deviation of the logarithm of the true scale over the believed one.
        hints: What is told of its place.
        doors_missing: Share of the rooms that have no door in the drawing, 0..1; 1 where nobody has looked.
        unused: Why it cannot be used; empty for a plan that can.

    Raises:
        MapError: The arrays differ in shape or hold nothing, or a room has an id above the limit or below 0.
        ConfigError: The resolution or spread is no number above 0.
    """

    name: str
    free: Mask
    room_ids: Ints32
    resolution: float
    scale_spread: float = UNKNOWN_SPREAD
    hints: PriorHints = field(default_factory=PriorHints)
    doors_missing: float = 1.0
    unused: str = ""

    def __post_init__(self) -> None:
        if self.free.ndim != 2 or not self.free.size or self.free.shape != self.room_ids.shape:
            raise MapError(
                f"prior plan {self.name}: free {self.free.shape} and rooms {self.room_ids.shape} must be "
                "one two-dimensional shape with cells"
            )
        check_ids(f"prior plan {self.name}", int(self.room_ids.max()))
        if self.room_ids.min() < 0:
            raise MapError(
                f"prior plan {self.name}: rooms count from 1, and 0 is none: got the id {self.room_ids.min()}"
            )
        check_kind("hints", self.hints, PriorHints)
        check(
            self,
            resolution=Rule(above=0.0, high=1e3),
            scale_spread=Rule(above=0.0, high=3.0),
            doors_missing=SHARE,
        )
        object.__setattr__(self, "room_ids", np.ascontiguousarray(self.room_ids, np.int32))
        object.__setattr__(self, "free", np.ascontiguousarray(self.free, np.bool_))
        object.__setattr__(self, "unused", self.unused or _why_unused(self))

    @property
    def size(self) -> tuple[float, float]:
        """(width, height) in metres at the believed scale."""
        rows, cols = self.free.shape
        return cols * self.resolution, rows * self.resolution

    @property
    def rooms(self) -> int:
        """Number of rooms."""
        ids = np.unique(self.room_ids)
        return int(np.count_nonzero(ids))

    def rescaled(self, factor: float, spread: float) -> PriorPlan:
        """The same drawing, a metre of it being `factor` metres; `spread` as of `scale_spread`."""
        here = self.hints.here and (self.hints.here[0] * factor, self.hints.here[1] * factor)
        hints = dataclasses.replace(self.hints, here=here)
        resolution = self.resolution * factor
        return dataclasses.replace(self, resolution=resolution, scale_spread=spread, hints=hints, unused="")


@checks_arguments
def check_here(hints: PriorHints, box: tuple[float, float, float, float], where: str) -> None:
    """See that the point where the robot starts, if one is told, lies within a plan.

    Args:
        hints: What is told.
        box: Least x and y, and greatest ones, of the plan.
        where: Its name and unit, for messages.

    Raises:
        ConfigError: It does not.
    """
    if hints.here is None:
        return
    (x, y), (x0, y0, x1, y1) = hints.here, box
    if not (x0 <= x <= x1 and y0 <= y <= y1):
        raise ConfigError(
            f"hint here: {x:g}/{y:g} lies outside of {where}: x is from {x0:g} to {x1:g}, y from {y0:g} to "
            f"{y1:g}"
        )


@checks_arguments
def prior_of_plan(plan: FloorPlan, hints: PriorHints | None = None) -> PriorPlan:
    """A floor plan as a prior; its metres are believed unless a scale is told.

    Raises:
        MapError: The plan has no free space.
        ConfigError: The robot is said to start outside of it.
    """
    hints = hints or PriorHints()
    check_here(hints, plan.bounds, f"{plan.file or plan.name}, in its metres")
    plan, factor = _in_metres(plan, hints.scale or 1.0)
    told = (hints.scale or 1.0) / factor
    resolution = RESOLUTION * max(
        1.0, math.sqrt(np.prod(np.subtract(plan.bounds[2:], plan.bounds[:2])) / 3e4)
    )
    raster = plan.rasterize(resolution)
    here = hints.here
    if here is not None:
        here = (told * (factor * here[0] - raster.origin.x), told * (factor * here[1] - raster.origin.y))
    prior = PriorPlan(
        name=plan.name,
        free=raster.free,
        room_ids=raster.room_ids,
        resolution=resolution * told,
        scale_spread=HINTED_SPREAD if hints.scale else KNOWN_SPREAD,
        hints=dataclasses.replace(hints, here=here),
    )
    whole = with_doors_to_all(prior)
    return dataclasses.replace(whole, unused=whole.unused or ("" if hints.scale else _unit_in_doubt(prior)))


def _in_metres(plan: FloorPlan, scale: float) -> tuple[FloorPlan, float]:
    """A plan in another unit in metres, and by what it was multiplied: cells and doors' reach are metres.

    Images keep their cells, and a plan that is no building at its scale stays as it is.
    """
    side = scale * max(np.subtract(plan.bounds[2:], plan.bounds[:2]).tolist())
    if scale == 1.0 or plan.source is not None or not math.sqrt(LEAST_AREA) <= side <= LONGEST:
        return plan, 1.0
    return plan.stretched(scale, scale), scale


@checks_arguments
def plan_of_nothing(name: str, unused: str = "", *, cells: int = 1, resolution: float = 1.0) -> PriorPlan:
    """A square plan of so many cells a side that shows no floor; `unused` is why it cannot be used."""
    nothing = np.zeros((cells, cells), np.bool_)
    room_ids = nothing.astype(np.int32)
    return PriorPlan(name=name, free=nothing, room_ids=room_ids, resolution=resolution, unused=unused)


@checks_arguments
def prior_of_rooms(
    rooms: Sequence[Polygon], *, name: str = "rooms", hints: PriorHints | None = None, metric: bool = False
) -> PriorPlan:
    """A list of room polygons as a prior; doors are assumed where rooms have none.

    Args:
        rooms: Outlines in any unit.
        name: For messages.
        hints: What is told of their place; a scale is the metres of a unit.
        metric: Whether the unit is a metre, more or less; else the scale is estimated from the rooms' sizes.

    Raises:
        MapError: There is no room, or one is no polygon with an area.
    """
    if not len(rooms) or not all(isinstance(p, Polygon) and p.is_valid and p.area > 0 for p in rooms):
        raise MapError(f"prior plan {name}: needs valid polygons with an area, at least one")
    hints = hints or PriorHints()
    side = math.sqrt(float(np.median([polygon.area for polygon in rooms])))
    unit = hints.scale or (1.0 if metric else ROOM_SIDE / side)
    here = hints.here and (unit * hints.here[0], unit * hints.here[1])
    scaled = tuple(
        Room(id=k + 1, polygon=shapely.transform(polygon, lambda points: points * unit))
        for k, polygon in enumerate(rooms)
    )
    known = dataclasses.replace(hints, scale=None, here=here)
    prior = prior_of_plan(FloorPlan(name=name, rooms=scaled), known)
    spread = HINTED_SPREAD if hints.scale else KNOWN_SPREAD if metric else ROOM_SPREAD
    return dataclasses.replace(
        prior,
        scale_spread=spread,
        hints=dataclasses.replace(prior.hints, scale=hints.scale),
        unused="" if hints.scale else prior.unused,
    )


@checks_arguments
def with_expected_scale(prior: PriorPlan) -> PriorPlan:
    """The plan at the scale at which its doors and rooms have their usual sizes."""
    factor, spread = expected_scale(prior)
    return prior.rescaled(factor, spread)


@checks_arguments
def expected_scale(prior: PriorPlan) -> tuple[float, float]:
    """By which factor a plan's lengths become usual ones, and the standard deviation of its logarithm."""
    areas = np.bincount(prior.room_ids.ravel())[1:]
    areas = areas[areas > 0]
    if not len(areas):
        return 1.0, UNKNOWN_SPREAD
    by_rooms = math.log(ROOM_SIDE / (math.sqrt(float(np.median(areas))) * prior.resolution))
    widths = _door_widths(prior)
    if len(widths) < LEAST_DOORS:
        return math.exp(by_rooms), ROOM_SPREAD
    by_doors = math.log(DOOR_WIDTH / float(np.median(widths)))
    if abs(by_doors - by_rooms) > 3 * ROOM_SPREAD:  # what was taken for doors is none
        return math.exp(by_rooms), ROOM_SPREAD
    weights = np.array([DOOR_SPREAD**-2, ROOM_SPREAD**-2])
    mean = float(np.average([by_doors, by_rooms], weights=weights))
    return math.exp(mean), float(weights.sum() ** -0.5)


def _door_widths(prior: PriorPlan) -> Floats:
    """Widths in metres of the openings between rooms."""
    # At a metre a cell gaps are small enough for doorways whatever the scale is.
    cells = np.bincount(prior.room_ids[prior.room_ids > 0])
    unit = ROOM_SIDE / max(math.sqrt(float(np.median(cells[cells > 0]))), 1.0)
    doors = trace_doors(PlanRaster(~prior.free, prior.room_ids, unit))
    widths = np.array([door.width for door in doors], np.float64)
    return widths[widths >= LEAST_DOOR_SHARE * ROOM_SIDE] * prior.resolution / unit


@checks_arguments
def with_doors_to_all(prior: PriorPlan) -> PriorPlan:
    """The plan in which every room can be entered: where no door is drawn, one is assumed.

    A room that is cut off opens to the largest neighbour across the thinnest wall, in the middle of what the
    two have in common.
    """
    free, reach, without = prior.free.copy(), WALL_REACH / prior.resolution, 0
    for _ in range(3):  # a room behind a room that was cut off itself
        count, parts, stats, _ = cv2.connectedComponentsWithStats(free.astype(np.uint8), connectivity=4)
        if count <= 2:
            break
        main = 1 + int(stats[1:, cv2.CC_STAT_AREA].argmax())
        least, most = (area / prior.resolution**2 for area in CUT_OFF_AREA)
        distance, nearest = nearest_cells(parts == main)
        sizes = stats[:, cv2.CC_STAT_AREA]
        closed = [k for k in range(1, count) if k != main and least <= sizes[k] <= most]
        without = max(without, len(closed))
        order, ends = np.argsort(parts, axis=None, kind="stable"), np.cumsum(sizes)
        for part in closed:
            members = order[ends[part] - sizes[part] : ends[part]]
            cells = np.stack(np.unravel_index(members, free.shape), axis=1)
            gaps = np.asarray(distance[cells[:, 0], cells[:, 1]])
            near = cells[gaps <= min(gaps.min() + 1.0, reach)]
            if not len(near):
                continue
            middle = near[np.abs(near - np.median(near, axis=0)).sum(axis=1).argmin()]
            end = nearest[middle[0], middle[1]]
            draw_way(free.view(np.uint8), middle, end, DOOR_WIDTH / prior.resolution, 1)
    share = min(1.0, without / max(1, prior.rooms))
    return dataclasses.replace(prior, free=free, doors_missing=share, unused="")


def _unit_in_doubt(prior: PriorPlan) -> str:
    """Why a plan's metres are none: its rooms and its doors are far from usual; empty where not."""
    areas = np.bincount(prior.room_ids.ravel())[1:]
    if np.count_nonzero(areas) < LEAST_ROOMS:
        return ""
    side, widths = math.sqrt(float(np.median(areas[areas > 0]))) * prior.resolution, _door_widths(prior)
    doors = ""
    if len(widths) < LEAST_DOORS:
        is_usual = side <= ROOMS_ALONE * ROOM_SIDE
    else:
        factors = side / ROOM_SIDE, float(np.median(widths)) / DOOR_WIDTH
        is_usual = min(factors) <= OTHER_UNIT and max(factors) >= 1 / OTHER_UNIT
        doors = f"its doors are {np.median(widths):.2g} m wide, and "
    return (
        "" if is_usual else f"{doors}its rooms have sides of {side:.2g} m: check its unit, or tell its scale"
    )


def _why_unused(prior: PriorPlan) -> str:
    """Why a plan tells nothing; empty where it does."""
    area = float(np.count_nonzero(prior.free)) * prior.resolution**2
    if not area:
        return "it shows no floor"
    if prior.rooms < LEAST_ROOMS:
        return f"it shows {prior.rooms} room, and where a single room lies cannot be told"
    if area < LEAST_AREA:
        return f"it shows {area:.2g} m2 of floor in all: check its unit, or tell its scale"
    if area > 1e6:
        return f"it shows {area:.2g} m2 of floor: check its unit, or tell its scale"
    if max(prior.size) > LONGEST:
        return f"it is {max(prior.size):.2g} m long, and no building is: check its unit, or tell its scale"
    return ""
