"""`LayoutExplore/Frontier-v0`: choose the next frontier until a building is explored."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
from gymnasium import spaces
from gymnasium.error import ResetNeeded
from numpy.typing import NDArray

from layoutexplore.envs.base import ExplorationEnv, configure, whole_action
from layoutexplore.envs.curriculum import Randomisation
from layoutexplore.envs.observation import Observation, ObservationConfig, Observer
from layoutexplore.envs.plans import PlanSpec
from layoutexplore.envs.privileged import PrivilegedView
from layoutexplore.envs.rewards import Reward
from layoutexplore.envs.viewer import Viewer
from layoutexplore.errors import ConfigError, checks_making
from layoutexplore.frontiers.decision import STOP, Choice
from layoutexplore.grids.arrays import Cells, Mask
from layoutexplore.options import COUNT, NON_NEGATIVE, check_kind
from layoutexplore.sensing.lidar import LidarConfig
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.looking_around import LookingAround


@checks_making
class FrontierEnv(ExplorationEnv[np.int64]):
    r"""Explore an unknown building by choosing, again and again, the frontier to look at next.

    ## Description
    A robot with a lidar stands in a building it does not know. It maps what it sees; the borders between
    known floor and the unknown are *frontiers*. Each step sends it to one of them along the shortest known
    path. It scans on the way, and the step ends on arrival, or earlier when the frontier has dissolved or the
    way is blocked. The task is to see all of the building that can be reached in as few metres as possible.

    The environment is a thin layer over `layoutexplore.Simulation`: the same choices give the same
    trajectory.

    ## Action Space
    `Discrete(max_frontiers + 1)`; with the default of 64 slots:

    | Num | Action |
    |---|---|
    | 0 ... 63 | go and look at that frontier; they are sorted by path length, nearest first |
    | 64 | stop: end the episode |

    The valid actions stand in `observation["action_mask"]`, in `info["action_mask"]` (both int8) and in
    `env.unwrapped.action_masks()` (bool, as sb3-contrib's `MaskablePPO` wants it). An invalid action moves
    nothing, costs `invalid_penalty` and is counted; after `max_invalid_actions` of them the episode is
    truncated. When there are more frontiers than slots, the farthest are left out. Stopping is valid only
    where no frontier is left with `ObservationConfig(early_stop=False)`.

    ## Observation Space
    `Dict`; images are uint8 and channel first, vectors float32. Lengths are in units of 10 m, areas of 10 m²
    (see `ObservationConfig`), clipped to the bounds of the space.

    | Key | Shape | Content |
    |---|---|---|
    | `local_map` | (7, 64, 64) | 12.8 m around the robot, the heading up |
    | `global_map` | (7, 84, 84) | the square around all that is known (20 m at least), north up |
    | `frontiers` | (64 * 13,) | a row per slot, flattened; zeros where there is no frontier |
    | `robot` | (9,) | the robot and the map as a whole |
    | `action_mask` | (65,) | 1 for valid actions |
    | `privileged` | (8,) | what only the floor plan tells, for the critic; only with `privileged=True` |
    | `foresight` | (3,) | what a plan known beforehand tells; only with `foresight=True` |

    Channels: `free` (share of the pixel), `occupied`, `frontier`, `trail` (where the robot has been),
    `predicted_room` (unknown cells of a predicted room), `predicted_wall` (unknown cells at the outline of
    one), `closed_room` (unknown cells of a room with a closed frontier). By default the rooms are *sketched*:
    with `predictor="layout"` the seen part of each room, grown from its frontiers by the area predicted
    behind them, walls that continue first. `ObservationConfig(rooms="completed")` shows the rooms that the
    predictor's network completes instead, for 30 to 200 ms a decision. The channels differ, `frontiers` and
    `robot` do not.

    `ObservationConfig(foresight=True)` adds the channels `foreseen_floor` and `foreseen_wall` (unknown cells
    that are foreseen free, or solid; within the frame of the known map) and the vector `foresight`:
    `confidence`, `floor` (area foreseen and not seen yet), `rooms` (foreseen rooms with 1 m² of it). They are
    filled by predictors that foresee, such as `prior:FILE` and `oracle:horizon=1`, and zero otherwise.

    | Column of `frontiers` | Content |
    |---|---|
    | `valid` | 1 where the slot holds a frontier |
    | `ahead`, `left` | position of its middle relative to the robot and its heading |
    | `path_length` | length of the shortest known path to where it is looked at from |
    | `straight_distance` | distance to its middle as the crow flies |
    | `turn` | direction of its middle relative to the heading, in half turns, -1 ... 1, left positive |
    | `size` | its length: number of cells times the resolution |
    | `visible_area` | unknown area that would be in view |
    | `detour` | metres by which the tour over frontiers that need not wait grows with this one first |
    | `tour_rank` | 1 / position in that tour, 0 when it is not in it |
    | `class` | 1 closed (the rest of a room), -1 open (leads on), 0 not predicted |
    | `expected_area` | predicted unknown area behind it |
    | `confidence` | of the class |

    `robot`: `heading_cos`, `heading_sin`, `distance` travelled, `known_area`, `frontier_count` (over the
    slots), `map_x`, `map_y` (where it is in the global map, 0 ... 1 from the lower left), `map_span` (side of
    the global map), `expected_area` (of all frontiers). Without a predictor, all that a layout would tell is
    zero. `detour` and `tour_rank` are zero unless switched on; the tour is the one that the tour agents
    follow (`layoutexplore.frontiers.tour_features`), over the frontiers of 1 m and more (0.4 m with a
    predictor) that are not closed with less than 1 m² left.

    `privileged`: `coverage`, `remaining_area` and `building_area`, `rooms_left` (share of the rooms with 1 m²
    or more to see), `remaining_tour` (length of a tour over their middles), `length_to_95` and `length_to_99`
    (its parts up to these coverages, estimates), `budget_used`. An agent that acts from decisions alone
    (`Observer`) sees the same observation, with zeros there.

    ## Starting State
    A floor plan drawn from `plan`, and a random free pose in its largest connected area, after one scan all
    around. `reset(options={"plan": ..., "start": (x, y, theta)})` sets either.

    ## Reward
    By name or as a callable that takes a `Transition`:

    | Name | Reward of a step |
    |---|---|
    | `path_length` (default) | -10 * metres / budget; +10 at the goal or out of frontiers, or 5 * coverage |
    | `path_to_marks` | -(metres before 95 % + before 99 % coverage) / (0.2 * (100 m + 1 m per m² of floor)) |
    | `area` | m² that became known |
    | `area_per_metre` | the same per metre travelled |
    | `room_area` | the same, and 5 for every room finished on the first visit |
    | `coverage` | gain of coverage in per cent |
    | `foreseen_area` | m² per metre that had been foreseen and came into view; 0 without foresight |

    ## Episode End
    Terminated: the coverage goal is reached (99 % of the floor that can be seen from where the robot can
    get), no frontier is left, or the agent stops. Truncated: the budget of metres is spent (100 m plus 1 m
    per m² of floor, unless `simulation` says otherwise), or too many invalid actions. If the first scan
    already shows everything, the first step ends the episode.

    ## Information
    After `reset` and every `step`: `coverage` (0 ... 1), `distance` (m), `known_area` (m²), `decisions`,
    `scans`, `stop_reason` (index into `STOP_REASONS`; 0 while the episode goes on), `plan_index` (which of
    the plans; -1 when it came through the options), `simulation_seed` (replays the episode in a
    `Simulation`), `frontier_count`, `invalid_actions`, `action_mask`. The floor plan's name is
    `env.unwrapped.plan_name`, of many `envs.call("plan_name")`.

    ## Arguments
    ```python
    gymnasium.make("LayoutExplore/Frontier-v0", plan="train", sensor="stage", reward="path_length")
    gymnasium.make_vec("LayoutExplore/Frontier-v0", num_envs=8, plan=PlanSampler(area=(300.0, 900.0)))
    ```

    Many at once are a vector environment of our own; its options (workers, when to reset) stand in
    `layoutexplore.envs.vector.ExplorationVectorEnv`.

    | Argument | Meaning |
    |---|---|
    | `plan` | a name, split, path, folder, `FloorPlan`, several, or `rng -> FloorPlan` (`PlanSampler`) |
    | `sensor` | a preset (`stage`, `indoor`, `short`, `mapex`) or a `LidarConfig` |
    | `resolution` | metres per cell (0.1) |
    | `robot_radius` | metres (0.2) |
    | `simulation` | a `SimulationConfig` for everything else; the three above override it |
    | `randomisation` | a `Randomisation`: sensors, noise and radii that change from episode to episode |
    | `predictor` | the name of a layout predictor (`layout`, `oracle`, `none`, ...), an object or class of |
    | | your own with `rooms(decision)` or `predict(decision)`, or None |
    | `reward` | a name or a callable |
    | `observation` | an `ObservationConfig` |
    | `look_every` | metres after which the robot looks all around on its way, where its lidar does not and |
    | | turning is free; the step ends there if that shows anything new (0: never) |
    | `invalid_penalty` | subtracted from the reward of an invalid action (0.1) |
    | `max_invalid_actions` | per episode (100) |
    | `render_mode`, `render_size` | `human`, `rgb_array`, `ansi` or None; (width, height) in pixels |

    ## References
    - B. Yamauchi, "A frontier-based approach for autonomous exploration", CIRA 1997.
    - M. Luperto, L. Fochetta, F. Amigoni, "Exploration of indoor environments through predicting the layout
      of partially observed rooms", AAMAS 2021.

    ## Version History
    - v0: first version.
    """

    def __init__(
        self,
        plan: PlanSpec = "train",
        *,
        sensor: str | LidarConfig | None = None,
        resolution: float | None = None,
        robot_radius: float | None = None,
        simulation: SimulationConfig | None = None,
        randomisation: Randomisation | None = None,
        predictor: object = None,
        reward: str | Reward = "path_length",
        observation: ObservationConfig | None = None,
        look_every: float = 0.0,
        invalid_penalty: float = 0.1,
        max_invalid_actions: int = 100,
        render_mode: str | None = None,
        render_size: tuple[int, int] = (960, 720),
    ) -> None:
        check_kind("observation", observation, ObservationConfig, optional=True)
        super().__init__(
            plan,
            configure(simulation, sensor=sensor, resolution=resolution, robot_radius=robot_radius),
            randomisation=randomisation,
            predictor=predictor,
            reward_function=reward,
            viewer=Viewer(render_mode, render_size, self.metadata["render_fps"], frontiers=True),
            watches_rooms=observation is not None and observation.privileged,
        )
        self.observation_config = observation or ObservationConfig()
        self._observer = Observer(self.observation_config)
        self.observation_space = self.observation_config.space
        self.action_space = spaces.Discrete(self.observation_config.max_frontiers + 1)
        self._privileged: PrivilegedView | None = None
        self._looking = LookingAround(float(NON_NEGATIVE.convert("look_every", look_every)))
        self._invalid_penalty = float(NON_NEGATIVE.convert("invalid_penalty", invalid_penalty))
        self._max_invalid_actions = COUNT.convert("max_invalid_actions", max_invalid_actions)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode; `options` may set the `plan` and the `start` (x, y[, theta])."""
        self._begin(seed, options)
        self._looking.forget()
        self._invalid_actions = 0
        if self.observation_config.privileged and self._ledger:
            self._privileged = PrivilegedView(self.observation_config, self.simulation, self._ledger)
        return self._outcome()

    def step(self, action: np.int64 | int) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Go to a frontier, or stop.

        Raises:
            ResetNeeded: The episode is over.
            ConfigError: The action is no whole number or outside the action space.
        """
        self._check_running()
        choice, simulation = whole_action(action), self.simulation
        stop = self.observation_config.max_frontiers
        if not 0 <= choice <= stop:
            raise ConfigError(f"action {choice} is outside of Discrete({stop + 1})")
        penalty = 0.0
        if not simulation.done:
            if self._mask[choice]:
                self.go(STOP if choice == stop else choice)
            else:
                penalty = self._count_invalid()
        reward, terminated, truncated = self._finish()
        observation, info = self._outcome()
        return observation, reward - penalty, terminated, truncated, info

    @property
    def info_types(self) -> dict[str, NDArray[np.generic]]:
        """Every entry of `info` as a zero of its shape and dtype."""
        counts = {"frontier_count": np.zeros((), np.int64), "invalid_actions": np.zeros((), np.int64)}
        mask = np.zeros(self.observation_config.max_frontiers + 1, np.int8)
        return super().info_types | counts | {"action_mask": mask}

    def action_masks(self) -> Mask:
        """Which actions are valid, bool (max_frontiers + 1,).

        Raises:
            ResetNeeded: There was no `reset`.
        """
        if self._simulation is None:
            raise ResetNeeded("no action is valid before reset(): call it first")
        return self._mask.astype(np.bool_)

    def go(self, choice: int) -> None:
        """Act on a choice until the next one is due, looking around on the way as `look_every` says.

        `step` does so and tells what came of it. Here a frontier may be chosen that has no slot.

        Args:
            choice: Which of the decision's frontiers, or `STOP`.

        Raises:
            ConfigError: There is no such frontier, or the run is over.
        """
        piece: Choice | None = self._looking.begin(self.simulation.decision, choice)
        while piece is not None:
            decision = self.simulation.step(piece)
            piece = None if self.simulation.done else self._looking.keep_on(decision, anew=True)

    def _count_invalid(self) -> float:
        self._invalid_actions += 1
        if self._invalid_actions >= self._max_invalid_actions:
            self.stop_reason = "invalid_actions"
        return self._invalid_penalty

    def _outcome(self) -> tuple[Observation, dict[str, Any]]:
        """Observation and info of the decision that is due; keeps the mask, updates the window if any."""
        decision = self.simulation.decision
        privileged = self._privileged.vector() if self._privileged else None
        observation = self._observer.observe(decision, privileged)
        self._mask = cast("Cells", observation["action_mask"].copy())
        info = self._info() | {
            "frontier_count": len(decision.frontiers),
            "invalid_actions": self._invalid_actions,
            "action_mask": self._mask.copy(),
        }
        if self.render_mode == "human":
            self.render()
        return observation, info
