"""Pictures of grids, floor plans and running simulations, with numpy and OpenCV only.

Everything is drawn y up, in the colours of `layoutexplore.drawing.palette`. `draw_state` is one frame of a
film: its size does not change during a run, and what the robot cannot know (the floor plan it has not seen)
is only hinted at.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from typing import TYPE_CHECKING

import cv2
import numpy as np

from layoutexplore.drawing import palette
from layoutexplore.drawing.dashboard import (
    draw_dashboard,
    keys_width,
    put_dot,
    put_keys,
    put_text,
    text_width,
)
from layoutexplore.drawing.palette import Image
from layoutexplore.drawing.room_fills import fills_of_rooms
from layoutexplore.drawing.view import SHIFT, View
from layoutexplore.errors import ConfigError, checks_arguments
from layoutexplore.frontiers.decision import Decision
from layoutexplore.frontiers.table import Frontier
from layoutexplore.grids.arrays import Bytes, Floats, Mask
from layoutexplore.grids.boxes import grown_box, known_box, true_box, union
from layoutexplore.grids.grid import OCCUPIED, OccupancyGrid, Pose, in_cells
from layoutexplore.grids.morphology import with_neighbours
from layoutexplore.maps.raster import PlanRaster
from layoutexplore.options import Rule
from layoutexplore.planning.shortest_paths import descend
from layoutexplore.sensing.lidar import Lidar

if TYPE_CHECKING:
    from layoutexplore.simulation.simulation import Simulation

_SCALE, _SIZE = Rule(kind=int, low=1, high=1000), Rule(kind=int, low=1, high=16_384, count=2)
_WIDTH = Rule(kind=int, low=320, high=8192)
_MOST_PIXELS = 300_000_000

_WALL_DEPTH = 0.3
"""Metres of solid ground beside free space that are drawn as wall; what lies farther in is left pale."""

_UNSEEN, _PREDICTED, _MISTAKEN, _FRONTIER = 101, 102, 103, 104
"""Codes for what is not a cell value: true floor that has not been seen, cells predicted to be the rest of a
room that are such floor, and that are not, and the first frontier class."""

_CLASSES = (palette.FRONTIER, palette.CLOSED, palette.OPEN)
"""Colours of frontiers without a class, closed ones and open ones."""

_KEYS = (
    (palette.CLOSED, "closed frontier"),
    (palette.OPEN, "open frontier"),
    (palette.PREDICTED, "predicted"),
)
"""What the colours of a prediction mean."""


@checks_arguments
def draw_grid(grid: OccupancyGrid, *, scale: int = 1) -> Image:
    """A grid as a picture: white free, dark occupied, pale grey unknown; cells in between are shaded.

    Args:
        grid: What to draw.
        scale: Pixels per cell.

    Returns:
        uint8 (rows * scale, cols * scale, 3) RGB; the top row is the highest y.
    """
    return _enlarge(_colours().take(grid.cells.view(np.uint8), axis=0), scale)


@checks_arguments
def draw_plan(raster: PlanRaster, *, scale: int = 1) -> Image:
    """A floor plan with its rooms in pale colours, neighbours in different ones, and its walls dark.

    Args:
        raster: What to draw.
        scale: Pixels per cell.

    Returns:
        uint8 (rows * scale, cols * scale, 3) RGB; the top row is the highest y.
    """
    fills = fills_of_rooms(raster.room_ids, raster.resolution)
    ground, wall = len(fills), len(fills) + 1
    codes = np.maximum(raster.room_ids, 0).astype(np.int32)
    codes[raster.occupied & (codes == 0)] = ground
    codes[_walls(raster)] = wall
    table = np.concatenate([fills, np.array([palette.CANVAS, palette.WALL], np.uint8)])
    image = table.take(codes, axis=0)
    return _enlarge(image, scale)


@checks_arguments
def draw_state(
    simulation: Simulation,
    *,
    size: tuple[int, int] | None = None,
    agent: str = "",
    target: int | None = None,
    frontiers: bool = True,
    truth: bool = True,
) -> Image:
    """A frame that shows where a run stands.

    The grid, what a predictor takes for the rest of rooms (strong where it is right), the frontiers with
    their viewpoints (in the colours of their classes), the path travelled (the older the paler), the robot
    with what it sees, the region to which it keeps, if there is one, and below them a bar with the plan, the
    agent, the coverage and its curve over the distance.

    Args:
        simulation: A simulation that has been reset.
        size: Width and height in pixels, 320 x 240 or more; None for 960 pixels and a height that suits the
            plan.
        agent: Name of the strategy for the caption.
        target: Index of the frontier the robot is about to go to; the path there is drawn.
        frontiers: Whether to draw frontiers; without them the decision that is due is not computed.
        truth: Whether to hint at the floor that has not been seen, and at mistaken predictions.

    Returns:
        uint8 (height, width, 3) RGB.

    Raises:
        ConfigError: The size is too small.
    """
    if size is not None:
        _SIZE.convert("the size of a frame", size)
    width, height = size or _suitable_size(simulation.raster.shape)
    if width < 320 or height < 240:
        raise ConfigError(f"a frame is at least 320 x 240 pixels, got {width} x {height}")
    bar = max(76, min(110, max(round(0.13 * height), round(0.09 * width))))
    decision = simulation.decision if frontiers else None
    view = View.fit(
        simulation.raster.shape, (width, height - bar), simulation.raster.resolution, simulation.raster.origin
    )
    floor = simulation.truth.target if truth else None
    image = view.place(
        _colours().take(_map_codes(simulation.mapper.grid, decision, view.scale, floor), axis=0)
    )
    _draw_region(image, view, simulation)
    _draw_sight(image, view, simulation)
    _draw_track(image, view, simulation.track)
    if decision is not None:
        _draw_choices(image, view, decision, target)
    _draw_robot(image, view, simulation.pose, simulation.config.robot_radius)
    if decision is not None and decision.rooms is not None:
        _draw_legend(image, view, simulation.raster.free)
    frame = np.empty((height, width, 3), np.uint8)
    frame[: height - bar] = image
    frame[height - bar :] = draw_dashboard(simulation, (width, bar), agent)
    return frame


@checks_arguments
def draw_decision(
    decision: Decision, *, width: int = 960, target: int | None = None, way: Floats | None = None
) -> Image:
    """A picture of a decision: the map, the predicted rest of rooms, the frontiers by class, way and robot.

    Args:
        decision: The decision, as of a `RobotMap` or of a simulation.
        width: In pixels; the height follows from the part of the map that is known or predicted.
        target: Index of the frontier the robot is about to go to; the path there is drawn.
        way: float64 (n, 2), points (x, y) in metres of another way to draw, as from `RobotMap.way`.

    Returns:
        uint8 (height, width, 3) RGB.
    """
    grid = decision.grid
    box = known_box(grid.cells)
    if decision.rooms is not None:
        box = union(box, true_box(decision.rooms.labels > 0))
    row0, row1, col0, col1 = grown_box(box, math.ceil(1.0 / grid.resolution), grid.shape)
    shape = row1 - row0, col1 - col0
    wide = _WIDTH.convert("width", width)
    high = min(max(round(wide * shape[0] / shape[1]), wide // 3), 2 * wide)
    corner = Pose(*grid.cell_to_world(row0 - 0.5, col0 - 0.5), grid.origin.theta)
    view = View.fit(shape, (wide, high), grid.resolution, corner)
    codes = _map_codes(grid, decision, view.scale, None)[row0:row1, col0:col1]
    image = view.place(_colours().take(codes, axis=0))
    if len(decision.track):
        _draw_track(image, view, decision.track)
    _draw_choices(image, view, decision, target, way)
    _draw_robot(image, view, decision.pose, decision.robot_radius)
    _draw_numbers(image, view, decision)
    if decision.rooms is None:
        return image
    legend = np.full((max(45, round(0.055 * wide)), wide, 3), palette.CANVAS, np.uint8)
    height = max(8, round(0.011 * wide))
    put_keys(legend, _KEYS, round(0.02 * wide), 3 * height, height)
    return np.concatenate([legend, image])


def _suitable_size(shape: tuple[int, int]) -> tuple[int, int]:
    """Width and height in even pixels (films need them even) for a map of (rows, cols) and a bar below."""
    high = round(960 * shape[0] / shape[1] / 0.87 / 2) * 2
    return 960, min(max(high, 480), 1080)


def _colours() -> Image:
    """uint8 (256, 3): the colour of each code; codes 0..100 and 255 are cell values as unsigned bytes."""
    table = np.full((256, 3), palette.CANVAS, np.uint8)
    shares = np.linspace(0.0, 1.0, OCCUPIED + 1)[:, None]
    table[: OCCUPIED + 1] = np.round((1 - shares) * np.array(palette.FREE) + shares * np.array(palette.WALL))
    table[[_UNSEEN, _PREDICTED, _MISTAKEN]] = palette.UNSEEN, palette.PREDICTED, palette.MISTAKEN
    table[_FRONTIER : _FRONTIER + len(_CLASSES)] = _CLASSES
    return table


def _enlarge(cells: Image, scale: int) -> Image:
    scale = _SCALE.convert("the scale, pixels a cell,", scale)
    if cells.size * scale**2 > _MOST_PIXELS:
        raise ConfigError(f"{cells.shape[1]} x {cells.shape[0]} cells are too many for a scale of {scale}")
    return np.ascontiguousarray(cells[::-1].repeat(scale, axis=0).repeat(scale, axis=1))


def _walls(raster: PlanRaster) -> Mask:
    """The occupied cells that lie beside free space, bool (rows, cols)."""
    return raster.occupied & with_neighbours(raster.free, in_cells(_WALL_DEPTH, raster.resolution))


def _map_codes(grid: OccupancyGrid, decision: Decision | None, scale: float, floor: Mask | None) -> Bytes:
    """The grid with what is predicted and the frontiers as codes of `_colours`, in grid order.

    Where the true floor is given, that of it which has not been seen is hinted at, and mistakes are shown.
    """
    codes = grid.cells.view(np.uint8).copy()
    known_wall = codes == OCCUPIED
    unknown = codes == 255
    if floor is not None:
        codes[unknown & floor] = _UNSEEN
    if decision is not None and decision.rooms is not None:
        predicted = unknown & (decision.rooms.labels > 0)
        codes[predicted] = _PREDICTED
        if floor is not None:
            codes[predicted & ~floor] = _MISTAKEN
    marks = np.zeros(codes.shape, np.uint8)
    for frontier in decision.frontiers if decision else ():
        marks[frontier.cells[:, 0], frontier.cells[:, 1]] = _FRONTIER + _class_of(frontier)
    reach = max(0, round((4.0 / scale - 1) / 2))
    if reach:
        marks[:] = cv2.dilate(
            marks, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
        )
    marks[known_wall] = 0
    return np.where(marks > 0, marks, codes)


def _class_of(frontier: Frontier) -> int:
    """0 for a frontier without a class, 1 for a closed one, 2 for an open one."""
    return 0 if frontier.is_closed is None else 1 if frontier.is_closed else 2


def _draw_region(image: Image, view: View, simulation: Simulation) -> None:
    """The outline of the region that is explored, if it is a part; what lies outside of it is paler."""
    if simulation.config.region is None:
        return
    corners = view.fixed(np.array(simulation.config.region, np.float64))
    outside = np.full(image.shape[:2], 255, np.uint8)
    cv2.fillPoly(outside, [corners], 0, shift=SHIFT)
    pale = outside > 0
    image[pale] = (image[pale].astype(np.uint16) + 2 * np.array(palette.CANVAS, np.uint16)) // 3
    cv2.polylines(image, [corners], True, palette.GREY, 2, cv2.LINE_AA, SHIFT)


def _draw_sight(image: Image, view: View, simulation: Simulation) -> None:
    """Tint what the lidar sees from where the robot is."""
    pose, lidar, raster = simulation.pose, simulation.lidar, simulation.raster
    if lidar.config.noisy:
        lidar = Lidar(
            replace(lidar.config, range_noise_std=0.0, dropout=0.0),
            raster.occupied,
            raster.resolution,
            raster.origin,
        )
    config = lidar.config
    ranges = np.minimum(lidar.scan(pose), config.range_max).astype(np.float64)
    angles = pose.theta + config.angles()
    rim = np.stack([pose.x + ranges * np.cos(angles), pose.y + ranges * np.sin(angles)], axis=1)
    outline = rim if config.full_turn else np.concatenate([[[pose.x, pose.y]], rim])
    tint = image.copy()
    cv2.fillPoly(tint, [view.fixed(outline).reshape(-1, 1, 2)], palette.SIGHT, cv2.LINE_AA, SHIFT)
    cv2.addWeighted(tint, 0.22, image, 0.78, 0.0, dst=image)


def _draw_track(image: Image, view: View, track: Floats) -> None:
    """The path travelled, from pale to strong."""
    points = view.fixed(track[:, :2]).reshape(-1, 1, 2)
    borders = np.unique(np.linspace(0, len(points) - 1, 25).astype(int))
    for first, last in itertools.pairwise(borders.tolist()):
        colour = palette.mix(palette.TRACK_OLD, palette.TRACK_NEW, last / (len(points) - 1))
        cv2.polylines(image, [points[first : last + 1]], False, colour, 2, cv2.LINE_AA, SHIFT)


def _draw_choices(
    image: Image, view: View, decision: Decision, target: int | None, way: Floats | None = None
) -> None:
    """Where the frontiers would be looked at from, and a way, or the path to the one that is gone to."""
    if target is not None and decision.frontiers:
        Rule(kind=int, low=0, high=len(decision.frontiers) - 1).convert("target", target)
        if way is None:
            cells = descend(decision.distances, decision.traversable, decision.frontiers[target].viewpoint)
            way = decision.grid.cells_to_world(cells)
    if way is not None:
        _draw_way(image, view, way)
    _draw_viewpoints(image, view, decision, target)


def _draw_way(image: Image, view: View, way: Floats) -> None:
    """The points float64 (n, 2) of a way, dashed."""
    points = view.fixed(np.asarray(way, np.float64).reshape(-1, 2)).reshape(-1, 1, 2)
    dash = max(2, round(7 / view.scale))
    for first in range(0, len(points) - 1, 2 * dash):
        cv2.polylines(
            image, [points[first : first + dash + 1]], False, palette.PLANNED, 2, cv2.LINE_AA, SHIFT
        )


def _draw_viewpoints(image: Image, view: View, decision: Decision, target: int | None) -> None:
    """A ring where each frontier would be looked at from."""
    points = view.fixed(decision.grid.cells_to_world(decision.viewpoints))
    for k, ((x, y), frontier) in enumerate(zip(points.tolist(), decision.frontiers, strict=True)):
        colour = _CLASSES[_class_of(frontier)]
        put_dot(image, (x, y), 4.5, palette.PLANNED if k == target else colour)


def _draw_numbers(image: Image, view: View, decision: Decision) -> None:
    """The number of each frontier beside its ring, where there is room for it; those of the nearest first."""
    height, taken = max(8, round(0.009 * image.shape[1])), np.zeros(image.shape[:2], np.bool_)
    points = np.round(view.pixels(decision.grid.cells_to_world(decision.viewpoints))).astype(int).tolist()
    for x, y in points:
        taken[max(y - 6, 0) : y + 7, max(x - 6, 0) : x + 7] = True
    for k, (x, y) in enumerate(points):
        top, left = max(y - height // 2 - 2, 0), x + 7
        box = slice(top, top + height + 4), slice(left, left + text_width(str(k), height) + 2)
        if not taken[box].any():
            taken[box] = True
            image[box] = palette.FREE
            put_text(image, str(k), left + 1, top + height + 2, height, palette.INK)


def _draw_robot(image: Image, view: View, pose: Pose, radius: float) -> None:
    """An arrowhead in the direction of travel, at least large enough to be found."""
    size = max(11.0, 1.6 * radius / view.resolution * view.scale)
    angles = pose.theta - view.origin.theta + np.array([0.0, 2.5, math.pi, -2.5])
    reach = size * np.array([1.0, 0.95, 0.35, 0.95])
    tip = np.stack([np.cos(angles), -np.sin(angles)], axis=1) * reach[:, None]
    centre = view.pixels(np.array([[pose.x, pose.y]])) - 0.5
    corners = np.round((centre + tip) * (1 << SHIFT)).astype(np.int32).reshape(-1, 1, 2)
    cv2.polylines(image, [corners], True, palette.WHITE, 5, cv2.LINE_AA, SHIFT)
    cv2.fillPoly(image, [corners], palette.ROBOT, cv2.LINE_AA, SHIFT)
    cv2.polylines(image, [corners], True, palette.INK, 1, cv2.LINE_AA, SHIFT)


def _draw_legend(image: Image, view: View, floor: Mask) -> None:
    """What the colours of a prediction mean, in the corner with the least `floor` bool (rows, cols)."""
    height = max(8, round(0.011 * image.shape[1]))
    pad, high, wide = round(0.02 * image.shape[1]), 4 * height, keys_width(_KEYS, height)
    right, low = image.shape[1] - pad - wide, image.shape[0] - height - high
    corners = [(top, left) for top in (height, low) for left in (pad, right)]
    below = [int(np.count_nonzero(floor[view.cells(*corner, high, wide)])) for corner in corners]
    top, left = (round(place) for place in corners[below.index(min(below))])
    if min(below):
        part = image[top : top + high, left : left + round(wide)]
        part[:] = (part.astype(np.uint16) + 3 * np.array(palette.CANVAS, np.uint16)) // 4
    put_keys(image, _KEYS, left, top + high // 2, height)
