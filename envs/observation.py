"""A decision as arrays: the observation of `LayoutExplore/Frontier-v0`.

An `Observer` follows one episode. It reads the same `Decision` that a heuristic agent reads, so a policy
knows neither more nor less. Where no predictor runs, everything that a layout would tell is zero and the
space stays the same.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, cast

import numpy as np
from numba import njit
from numpy.typing import NDArray

from layoutexplore.envs import egocentric_maps as map_images
from layoutexplore.envs import foreseen
from layoutexplore.envs.egocentric_maps import CHANNELS, LAYOUT_CHANNELS, NOWHERE, MapFrame, Trail
from layoutexplore.errors import checks_calls
from layoutexplore.frontiers.decision import Decision
from layoutexplore.frontiers.table import FrontierTable
from layoutexplore.frontiers.tour_features import TourConfig, tour_features
from layoutexplore.grids.arrays import Bytes, Cells, Floats, Floats32
from layoutexplore.grids.grid import OccupancyGrid
from layoutexplore.options import FLAG, Rule, check, check_kind

if TYPE_CHECKING:
    from gymnasium import spaces

Observation = dict[str, NDArray[np.generic]]
"""Arrays by name."""

_FAR = 100.0
_LARGE = 1000.0

FRONTIER_FEATURES: dict[str, tuple[float, float]] = {
    "valid": (0.0, 1.0),
    "ahead": (-_FAR, _FAR),
    "left": (-_FAR, _FAR),
    "path_length": (0.0, _FAR),
    "straight_distance": (0.0, _FAR),
    "turn": (-1.0, 1.0),
    "size": (0.0, _FAR),
    "visible_area": (0.0, _LARGE),
    "detour": (0.0, _FAR),
    "tour_rank": (0.0, 1.0),
    "class": (-1.0, 1.0),
    "expected_area": (0.0, _LARGE),
    "confidence": (0.0, 1.0),
}
"""The columns of a frontier and their bounds; units are `length_scale` and `area_scale`."""

ROBOT_FEATURES: dict[str, tuple[float, float]] = {
    "heading_cos": (-1.0, 1.0),
    "heading_sin": (-1.0, 1.0),
    "distance": (0.0, _LARGE),
    "known_area": (0.0, _LARGE),
    "frontier_count": (0.0, 100.0),
    "map_x": (0.0, 1.0),
    "map_y": (0.0, 1.0),
    "map_span": (0.0, _LARGE),
    "expected_area": (0.0, _LARGE),
}
"""The entries of the robot vector and their bounds."""

PRIVILEGED_FEATURES: dict[str, tuple[float, float]] = {
    "coverage": (0.0, 1.0),
    "remaining_area": (0.0, _LARGE),
    "building_area": (0.0, _LARGE),
    "rooms_left": (0.0, 1.0),
    "remaining_tour": (0.0, _LARGE),
    "length_to_95": (0.0, _LARGE),
    "length_to_99": (0.0, _LARGE),
    "budget_used": (0.0, 1.0),
}
"""The entries of the privileged vector and their bounds.

The share of the target seen, the area of it not seen yet and in all, the share of rooms with something left,
the length of a tour over these and of its parts up to 95 and 99 % coverage (estimates), and the share of the
metres that may be travelled.
"""

_SWITCHES = "local_map", "global_map", "layout_channels", "foresight", "detour", "privileged", "early_stop"
_PIXELS, _SCALE = Rule(kind=int, low=8, high=2048), Rule(low=1e-6, high=1e6)


@dataclass(frozen=True, kw_only=True)
class ObservationConfig:
    """What `LayoutExplore/Frontier-v0` shows of a decision.

    Attributes:
        max_frontiers: Slots for frontiers; when there are more, the nearest are shown. 64 hold nearly every
            decision on real floors (12 to 45 is usual, 80 the most seen).
        local_map: Whether to show the close view.
        local_size: Its side in pixels.
        local_span: Its side in metres.
        global_map: Whether to show the whole map.
        global_size: Its side in pixels.
        global_min_span: Its least side in metres; it grows with what is known.
        layout_channels: Whether the maps have the channels of the predicted layout (zero without a
            predictor).
        rooms: Which rooms these channels show. "sketched" (a millisecond): the predictor's classes and areas
            drawn as rooms, `layoutexplore.predictors.room_sketch` for `layout`, its own rooms for predictors
            that have them at once. "completed": the rooms of `layoutexplore evaluate partial-rooms`; with
            `layout` a network completes them, which takes 30 to 200 ms a decision.
        foresight: Whether the maps have the channels of foreseen floor and walls, and the observation the
            vector `foresight` (`layoutexplore.envs.foreseen`).
        detour: Whether to compute the columns `detour` and `tour_rank`: the distances between all frontiers
            and a tour, a millisecond or two a decision. Without it the columns are zero.
        tour: How the tour behind these columns weighs path lengths and areas.
        privileged: Whether the environment adds the entry `privileged`, what only the floor plan tells (see
            `layoutexplore.envs.privileged`): for the critic of an actor-critic in training, never for the
            policy. An agent that acts from decisions alone sees zeros there.
        early_stop: Whether stopping is valid while there are frontiers. A policy that begins by chance
            stops by chance, and may learn to stop at once before it learns to explore.
        length_scale: Metres that count as 1 in the vectors.
        area_scale: Square metres that count as 1 in the vectors.

    Raises:
        ConfigError: A value makes no sense.
    """

    max_frontiers: int = 64
    local_map: bool = True
    local_size: int = 64
    local_span: float = 12.8
    global_map: bool = True
    global_size: int = 84
    global_min_span: float = 20.0
    layout_channels: bool = True
    rooms: str = "sketched"
    foresight: bool = False
    detour: bool = False
    tour: TourConfig = field(default_factory=TourConfig)
    privileged: bool = False
    early_stop: bool = True
    length_scale: float = 10.0
    area_scale: float = 10.0

    def __post_init__(self) -> None:
        check(
            self,
            max_frontiers=Rule(kind=int, low=1, high=10_000),
            local_size=_PIXELS,
            local_span=Rule(above=0.0, high=500.0),
            global_size=_PIXELS,
            global_min_span=Rule(above=0.0, high=1e5),
            rooms=Rule(kind=str, choices=("sketched", "completed")),
            length_scale=_SCALE,
            area_scale=_SCALE,
            **dict.fromkeys(_SWITCHES, FLAG),
        )
        check_kind("tour", self.tour, TourConfig)

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the maps' channels."""
        layout = LAYOUT_CHANNELS if self.layout_channels else ()
        return CHANNELS + layout + (foreseen.FORESIGHT_CHANNELS if self.foresight else ())

    @property
    def space(self) -> spaces.Space[Observation]:
        """The observation space, a `Dict`."""
        from gymnasium import spaces

        count, channels = self.max_frontiers, len(self.channels)
        low, high = bounds(FRONTIER_FEATURES)
        parts: dict[str, spaces.Space[NDArray[np.generic]]] = {
            "frontiers": spaces.Box(np.tile(low, count), np.tile(high, count)),
            "robot": spaces.Box(*bounds(ROBOT_FEATURES)),
            "action_mask": spaces.MultiBinary(count + 1),
        }
        if self.privileged:
            parts["privileged"] = spaces.Box(*bounds(PRIVILEGED_FEATURES))
        if self.foresight:
            parts["foresight"] = spaces.Box(*bounds(foreseen.FORESIGHT_FEATURES))
        for name, shown, size in (
            ("local_map", self.local_map, self.local_size),
            ("global_map", self.global_map, self.global_size),
        ):
            if shown:
                parts[name] = spaces.Box(0, 255, (channels, size, size), np.uint8)
        return cast(spaces.Space[Observation], spaces.Dict(parts))


def bounds(features: Mapping[str, tuple[float, float]]) -> tuple[Floats32, Floats32]:
    """The least and the greatest values of named features, each float32 (features,)."""
    low, high = np.array(list(features.values()), np.float32).T
    return low, high


@checks_calls
class Observer:
    """Turns decisions into observations, one episode after the other.

    Everything comes from the decisions, so that an agent with an observer of its own sees what the
    environment shows. It has to be shown every decision of an episode, in order: a new episode is recognised
    by its new grid.

    Args:
        config: What to show.
    """

    def __init__(self, config: ObservationConfig) -> None:
        self.config = config
        self._grid: OccupancyGrid | None = None

    def observe(self, decision: Decision, privileged: Floats32 | None = None) -> Observation:
        """The observation of a decision; all arrays are new.

        Args:
            decision: The decision that is due.
            privileged: float32 (features,), what the floor plan tells, where the config asks for it; zeros
                when None.
        """
        config, pose = self.config, decision.pose
        observation: Observation = {
            "frontiers": encode_frontiers(decision, config),
            "action_mask": action_mask(decision, config.max_frontiers, early_stop=config.early_stop),
        }
        if config.privileged:
            shown = np.zeros(len(PRIVILEGED_FEATURES), np.float32) if privileged is None else privileged
            observation["privileged"] = shown
        if config.foresight:
            observation["foresight"] = foreseen.encode_foresight(decision, config.area_scale)
        frame = NOWHERE
        if config.local_map or config.global_map:
            marks = self._marked(decision)
        if config.local_map:
            observation["local_map"] = map_images.draw_local_map(
                decision.grid,
                marks,
                pose,
                size=config.local_size,
                span=config.local_span,
                channels=len(config.channels),
            )
        if config.global_map:
            observation["global_map"], frame = map_images.draw_global_map(
                decision.grid,
                marks,
                size=config.global_size,
                min_span=config.global_min_span,
                channels=len(config.channels),
            )
        observation["robot"] = encode_robot(decision, config, frame)
        return observation

    def _follow(self, decision: Decision) -> None:
        """Add what was walked since the last decision to the trail."""
        if decision.grid is not self._grid:
            self._grid, self._trail, self._shown = decision.grid, Trail(decision.grid), 0
        if len(decision.track) > self._shown:
            self._trail.extend(decision.track[max(0, self._shown - 1) :])
            self._shown = len(decision.track)

    def _marked(self, decision: Decision) -> Bytes:
        """The trail, the frontiers and what the layout predicts, as bits."""
        self._follow(decision)
        marks = self._trail.marks.copy()
        if decision.rooms is not None and self.config.layout_channels:
            marks |= map_images.layout_marks(decision, self.config.rooms)
        if self.config.foresight:
            foreseen.mark_foreseen(
                decision, marks, self.config.channels.index(foreseen.FORESIGHT_CHANNELS[0])
            )
        marks[tuple(decision.clusters.cells.T)] |= map_images.FRONTIER
        return marks


def action_mask(decision: Decision, max_frontiers: int, *, early_stop: bool = True) -> Cells:
    """Which actions are valid, int8 (max_frontiers + 1,): the frontiers in their slots, and to stop.

    Without `early_stop` that is valid only where there is no frontier.
    """
    mask = np.zeros(max_frontiers + 1, np.int8)
    mask[: len(decision.frontiers)] = 1
    mask[max_frontiers] = early_stop or not decision.frontiers
    return mask


def encode_frontiers(decision: Decision, config: ObservationConfig) -> Floats32:
    """float32 (max_frontiers * features,): a row of `FRONTIER_FEATURES` per slot, zero in empty ones."""
    table = np.zeros((config.max_frontiers, len(FRONTIER_FEATURES)), np.float32)
    shown = decision.table.first(config.max_frontiers)
    count = len(shown.x)
    if count:
        rank = detour = np.zeros(count)
        if config.detour:
            rank, detour = (column[:count] for column in tour_features(decision, config.tour))
        limits = _FRONTIER_LOW, _FRONTIER_HIGH
        _encode(shown, decision.pose, config.length_scale, config.area_scale, rank, detour, limits, table)
    return table.ravel()


@njit(cache=True, nogil=True)
def _encode(
    shown: FrontierTable,
    pose: tuple[float, float, float],
    metres: float,
    square_metres: float,
    rank: Floats,
    detour: Floats,
    limits: tuple[Floats32, Floats32],
    table: Floats32,
) -> None:
    """Write the rows of `FRONTIER_FEATURES` from a table of frontiers, a row a frontier."""
    (x, y, theta), (low, high) = pose, limits
    for k in range(len(shown.x)):
        # The robot's frame: x ahead, y to the left.
        dx, dy = shown.x[k] - x, shown.y[k] - y
        ahead = (dx * math.cos(theta) + dy * math.sin(theta)) / metres
        left = (dy * math.cos(theta) - dx * math.sin(theta)) / metres
        # In the order of `FRONTIER_FEATURES`.
        row = (
            1.0,
            ahead,
            left,
            shown.path_length[k] / metres,
            shown.straight_distance[k] / metres,
            math.atan2(left, ahead) / math.pi,
            shown.size[k] / metres,
            shown.visible_area[k] / square_metres,
            detour[k] / metres,
            rank[k],
            shown.closed[k],
            shown.expected_area[k] / square_metres,
            shown.confidence[k],
        )
        for n in range(len(row)):
            table[k, n] = min(max(row[n], low[n]), high[n])


def encode_robot(decision: Decision, config: ObservationConfig, frame: MapFrame) -> Floats32:
    """float32 (features,): the entries of `ROBOT_FEATURES`; those of the map are 0 without a global map."""
    grid, pose = decision.grid, decision.pose
    map_x = map_y = span = 0.0
    if config.global_map:
        cells = frame.cells_per_pixel * config.global_size
        row, col = map_images.place_on(grid, pose.x, pose.y)
        map_x, map_y = (col - frame.col) / cells, (row - frame.row) / cells
        span = cells * grid.resolution / config.length_scale
    heading = pose.theta - grid.origin.theta  # that of the global map
    expected = sum(decision.table.expected_area.tolist())
    values = (
        math.cos(heading),
        math.sin(heading),
        decision.distance / config.length_scale,
        grid.free_area / config.area_scale,
        len(decision.frontiers) / config.max_frontiers,
        map_x,
        map_y,
        span,
        expected / config.area_scale,
    )
    return np.clip(values, _ROBOT_LOW, _ROBOT_HIGH).astype(np.float32)


_FRONTIER_LOW, _FRONTIER_HIGH = bounds(FRONTIER_FEATURES)
_ROBOT_LOW, _ROBOT_HIGH = bounds(ROBOT_FEATURES)
