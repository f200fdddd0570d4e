"""`LayoutExplore/Motion-v0`: drive a robot through a building, one short move and one scan at a time."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from layoutexplore.envs.base import ExplorationEnv, configure, whole_action
from layoutexplore.envs.curriculum import Randomisation
from layoutexplore.envs.egocentric_maps import CHANNELS, Trail, draw_local_map
from layoutexplore.envs.observation import Observation, bounds
from layoutexplore.envs.plans import PlanSpec
from layoutexplore.envs.rewards import Reward
from layoutexplore.envs.viewer import Viewer
from layoutexplore.errors import ConfigError, checks_making, shortened
from layoutexplore.grids.arrays import Floats32
from layoutexplore.options import Rule, check, check_kind
from layoutexplore.sensing.lidar import Lidar, LidarConfig
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.simulation import Simulation

ACTIONS = ("discrete", "continuous")

_LARGE = 1000.0

ROBOT_FEATURES: dict[str, tuple[float, float]] = {
    "heading_cos": (-1.0, 1.0),
    "heading_sin": (-1.0, 1.0),
    "moved": (-1.0, 1.0),
    "collided": (0.0, 1.0),
    "new_area": (0.0, _LARGE),
    "distance": (0.0, _LARGE),
    "known_area": (0.0, _LARGE),
}
"""The entries of the robot vector and their bounds."""

_LOW, _HIGH = bounds(ROBOT_FEATURES)


@dataclass(frozen=True, kw_only=True)
class MotionConfig:
    """What `LayoutExplore/Motion-v0` shows, and how far a move goes.

    Attributes:
        forward: Metres of a full move forward.
        turn: Radians of a full turn.
        local_size: Side of the close view in pixels.
        local_span: Its side in metres.
        scan_beams: Beams of the scan that is shown, spread over the sensor's field of view.
        length_scale: Metres that count as 1 in the robot vector.
        area_scale: Square metres that count as 1 in the robot vector.

    Raises:
        ConfigError: A value makes no sense.
    """

    forward: float = 0.25
    turn: float = math.radians(30)
    local_size: int = 64
    local_span: float = 12.8
    scan_beams: int = 90
    length_scale: float = 10.0
    area_scale: float = 10.0

    def __post_init__(self) -> None:
        check(
            self,
            forward=Rule(low=1e-3, high=100.0),
            turn=Rule(above=0.0, high=2 * math.pi),
            local_size=Rule(kind=int, low=8, high=2048),
            local_span=Rule(above=0.0, high=500.0),
            scan_beams=Rule(kind=int, low=1, high=100_000),
            length_scale=Rule(low=1e-6, high=1e6),
            area_scale=Rule(low=1e-6, high=1e6),
        )

    @property
    def space(self) -> spaces.Space[Observation]:
        """The observation space, a `Dict`."""
        space: Any = spaces.Dict(
            {
                "local_map": spaces.Box(0, 255, (len(CHANNELS), self.local_size, self.local_size), np.uint8),
                "scan": spaces.Box(0.0, 1.0, (self.scan_beams,), np.float32),
                "robot": spaces.Box(_LOW, _HIGH),
            }
        )
        return cast(spaces.Space[Observation], space)


@checks_making
class MotionEnv(ExplorationEnv[Any]):
    r"""Explore an unknown building by driving: forward, left, right.

    ## Description
    The same robot, buildings and sensors as in `LayoutExplore/Frontier-v0`, but each step is a short move
    with one scan at its end. Walls stop the robot where they stand; touching one puts it on the map. The task
    is to see all of the building that can be reached in as few metres as possible.

    The environment is a thin layer over `layoutexplore.Simulation.drive`.

    ## Action Space
    With `actions="discrete"` (the default) `Discrete(3)`:

    | Num | Action |
    |---|---|
    | 0 | forward by 0.25 m, or until a wall |
    | 1 | turn left by 30 degrees |
    | 2 | turn right by 30 degrees |

    With `actions="continuous"` `Box(-1, 1, (2,))`: first turn by the second number times 30 degrees (left
    positive), then go forward by (1 + the first number) / 2 times 0.25 m. `MotionConfig` sets both lengths.

    ## Observation Space
    `Dict`; lengths are in units of 10 m, areas of 10 m², clipped to the bounds of the space.

    | Key | Shape | Content |
    |---|---|---|
    | `local_map` | (4, 64, 64) uint8 | 12.8 m around the robot, the heading up |
    | `scan` | (90,) float32 | ranges over the field of view, from right to left, as shares of the greatest |
    | `robot` | (7,) float32 | see below |

    Channels of the map: `free`, `occupied`, `frontier`, `trail`. A beam without return is 1. With sensor
    noise the scan is a reading of its own, besides the one that is mapped.

    `robot`: `heading_cos`, `heading_sin`, `moved` (share of a full move forward that the last step made),
    `collided` (1 when a wall stopped it), `new_area` (of the last step), `distance` travelled, `known_area`.

    ## Starting State
    A floor plan drawn from `plan`, and a random free pose in its largest connected area, after one scan all
    around. `reset(options={"plan": ..., "start": (x, y, theta)})` sets either.

    ## Reward
    By name or as a callable that takes a `Transition`; the same as for `LayoutExplore/Frontier-v0`. The
    default is `area`, the floor in m² that became known in the step.

    ## Episode End
    Terminated: the coverage goal is reached (99 % of the floor that can be seen from where the robot can
    get). Truncated: the budget of metres is spent (100 m plus 1 m per m² of floor, unless `simulation` says
    otherwise), or `max_steps` are made (by default as many as would drive the budget four times over).

    ## Information
    After `reset` and every `step`: `coverage` (0 ... 1), `distance` (m), `known_area` (m²), `decisions`
    (moves), `scans`, `stop_reason` (index into `STOP_REASONS`; 0 while the episode goes on), `plan_index`
    (which of the plans; -1 when it came through the options), `simulation_seed` (replays the episode in a
    `Simulation`), `collisions`.

    ## Arguments
    ```python
    gymnasium.make("LayoutExplore/Motion-v0", plan="train", actions="continuous", sensor="indoor")
    gymnasium.make_vec("LayoutExplore/Motion-v0", num_envs=8, backend="serial")
    ```

    Many at once are a vector environment of our own; see `layoutexplore.envs.vector.ExplorationVectorEnv`.

    | Argument | Meaning |
    |---|---|
    | `plan` | a name, split, path, folder, `FloorPlan`, several, or `rng -> FloorPlan` (`PlanSampler`) |
    | `actions` | `discrete` or `continuous` |
    | `sensor` | a preset (`stage`, `indoor`, `short`, `mapex`) or a `LidarConfig` |
    | `resolution` | metres per cell (0.1) |
    | `robot_radius` | metres (0.2) |
    | `simulation` | a `SimulationConfig` for everything else; the three above override it |
    | `randomisation` | a `Randomisation`: sensors, noise and radii that change from episode to episode |
    | `reward` | a name or a callable |
    | `motion` | a `MotionConfig` |
    | `max_steps` | moves per episode, or None |
    | `render_mode`, `render_size` | `human`, `rgb_array`, `ansi` or None; (width, height) in pixels |

    ## References
    - T. Li et al., "HouseExpo: a large-scale 2D indoor layout dataset for learning-based algorithms on mobile
      robots", IROS 2020: motion primitives with an egocentric map.

    ## Version History
    - v0: first version.
    """

    metadata: dict[str, Any] = {**ExplorationEnv.metadata, "render_fps": 15}  # noqa: RUF012

    def __init__(
        self,
        plan: PlanSpec = "train",
        *,
        actions: str = "discrete",
        sensor: str | LidarConfig | None = None,
        resolution: float | None = None,
        robot_radius: float | None = None,
        simulation: SimulationConfig | None = None,
        randomisation: Randomisation | None = None,
        reward: str | Reward = "area",
        motion: MotionConfig | None = None,
        max_steps: int | None = None,
        render_mode: str | None = None,
        render_size: tuple[int, int] = (960, 720),
    ) -> None:
        super().__init__(
            plan,
            configure(simulation, sensor=sensor, resolution=resolution, robot_radius=robot_radius),
            randomisation=randomisation,
            predictor=None,
            reward_function=reward,
            viewer=Viewer(render_mode, render_size, self.metadata["render_fps"], frontiers=False),
        )
        check_kind("motion", motion, MotionConfig, optional=True)
        if not isinstance(actions, str) or actions not in ACTIONS:
            raise ConfigError(f"actions must be one of {', '.join(ACTIONS)}, got {shortened(actions)}")
        self.motion = motion or MotionConfig()
        self._max_steps = Rule(kind=int, low=1, optional=True).convert("max_steps", max_steps)
        self.observation_space = self.motion.space
        self.action_space = (
            spaces.Discrete(3) if actions == "discrete" else spaces.Box(-1.0, 1.0, (2,), np.float32)
        )
        turn = self.motion.turn
        self._primitives = (
            ((self.motion.forward, 0.0), (0.0, turn), (0.0, -turn)) if actions == "discrete" else None
        )
        self._sensor: Lidar | None = None
        self._sensor_of: Simulation | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode; `options` may set the `plan` and the `start` (x, y[, theta])."""
        self._begin(seed, options)
        simulation = self.simulation
        if self._sensor is None or simulation is not self._sensor_of:
            raster = simulation.raster
            beams = replace(simulation.lidar.config, beams=self.motion.scan_beams)
            self._sensor = Lidar(beams, raster.occupied, raster.resolution, raster.origin)
            self._sensor_of = simulation
        self._rng = np.random.default_rng(self._simulation_seed)
        self._trail = Trail(simulation.mapper.grid)
        self._steps_left = self._max_steps or math.ceil(4 * simulation.max_distance / self.motion.forward)
        return self._outcome(0.0, False, 0)

    def step(self, action: Any) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Make one move.

        Raises:
            ResetNeeded: The episode is over.
            ConfigError: The action is outside the action space.
        """
        self._check_running()
        forward, turn = self._move(action)
        moved, collided, new_cells = 0.0, False, 0
        if not self.simulation.done:
            moved, collided, new_cells = self.simulation.drive(forward, turn)
            self._steps_left -= 1
            if self._steps_left <= 0 and not self.simulation.done:
                self.stop_reason = "steps"
        reward, terminated, truncated = self._finish()
        observation, info = self._outcome(moved, collided, new_cells)
        return observation, reward, terminated, truncated, info

    @property
    def info_types(self) -> dict[str, NDArray[np.generic]]:
        """Every entry of `info` as a zero of its shape and dtype."""
        return super().info_types | {"collisions": np.zeros((), np.int64)}

    def _move(self, action: Any) -> tuple[float, float]:
        """Metres forward and radians to the left."""
        if self._primitives is not None:
            number = whole_action(action)
            if not 0 <= number < len(self._primitives):
                raise ConfigError(f"action {number} is outside of Discrete({len(self._primitives)})")
            return self._primitives[number]
        ahead, left = _pair(action)
        if not (-1.0 <= ahead <= 1.0 and -1.0 <= left <= 1.0):
            raise ConfigError(f"action ({ahead}, {left}) is outside of Box(-1, 1)")
        return self.motion.forward * (1.0 + ahead) / 2, self.motion.turn * left

    def _outcome(self, moved: float, collided: bool, new_cells: int) -> tuple[Observation, dict[str, Any]]:
        """Observation and info after a move; shows the window in mode "human"."""
        simulation = self.simulation
        robot = simulation.robot
        self._trail.extend(robot.believed_track[-2:])
        info = self._info() | {"collisions": robot.collisions}
        observation: Observation = {
            "local_map": draw_local_map(
                simulation.mapper.grid,
                self._trail.marks,
                robot.believed,
                size=self.motion.local_size,
                span=self.motion.local_span,
                channels=len(CHANNELS),
                detect=True,
            ),
            "scan": self._scan(),
            "robot": self._robot(moved, collided, new_cells, info),
        }
        if self.render_mode == "human":
            self.render()
        return observation, info

    def _scan(self) -> Floats32:
        """Ranges float32 (scan_beams,) as shares of the greatest range."""
        assert self._sensor is not None
        ranges = self._sensor.scan(self.simulation.pose, self._rng)
        shares: Floats32 = np.fmin(ranges / np.float32(self._sensor.config.range_max), np.float32(1.0))
        return shares

    def _robot(self, moved: float, collided: bool, new_cells: int, info: dict[str, Any]) -> Floats32:
        """The entries of `ROBOT_FEATURES`, float32."""
        believed, motion = self.simulation.robot.believed, self.motion
        cell_area = self.simulation.raster.resolution**2
        values = (
            math.cos(believed.theta),
            math.sin(believed.theta),
            moved / motion.forward,
            float(collided),
            new_cells * cell_area / motion.area_scale,
            info["distance"] / motion.length_scale,
            info["known_area"] / motion.area_scale,
        )
        robot: Floats32 = np.minimum(np.maximum(np.array(values, np.float32), _LOW), _HIGH)
        return robot


def _pair(action: Any) -> tuple[float, float]:
    """The two numbers of a continuous action."""
    try:
        numbers = np.asarray(action)
        if numbers.shape != (2,) or numbers.dtype.kind not in "fiu":
            raise ValueError
        return float(numbers[0]), float(numbers[1])
    except Exception:  # whatever an object raises that is asked for its numbers
        raise ConfigError(f"an action is two numbers from -1 to 1, got {shortened(action)}") from None
