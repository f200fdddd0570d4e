"""What both environments share: floor plans, seeds, rewards, bookkeeping and rendering.

All physics is in `layoutexplore.simulation.simulation`; an environment only translates between it and
Gymnasium.
"""

from __future__ import annotations

import math
import operator
import os
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Self, TypeVar, cast

import gymnasium
import numpy as np
from gymnasium.error import ResetNeeded
from numpy.typing import NDArray

from layoutexplore.envs.curriculum import Randomisation
from layoutexplore.envs.foreseen import came_true, hidden_floor
from layoutexplore.envs.observation import Observation
from layoutexplore.envs.plans import PlanSource, PlanSpec, load
from layoutexplore.envs.rewards import Reward, Transition, reads_foresight, reads_rooms, reward
from layoutexplore.envs.room_progress import RoomLedger
from layoutexplore.envs.viewer import RENDER_MODES, Viewer
from layoutexplore.errors import ConfigError, StartError, shortened, unknown_name
from layoutexplore.frontiers.decision import Predictor
from layoutexplore.grids.arrays import Bytes, Mask
from layoutexplore.grids.grid import Pose
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.metrics.exploration import FULLY_SEEN, NEARLY_SEEN, distance_to_coverage
from layoutexplore.options import SEED, check_keys, check_kind
from layoutexplore.plugins.signatures import signature_of
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.simulation import Simulation
from layoutexplore.simulation.stop_reasons import StopReason

Action = TypeVar("Action")

STOP_REASONS = (*(reason.value for reason in StopReason), "invalid_actions", "steps")
"""Why an episode ended; `info["stop_reason"]` is the index. From "budget" on all but "agent" truncate."""

_INFO: dict[str, type[np.generic]] = {
    "coverage": np.float64,
    "distance": np.float64,
    "known_area": np.float64,
    "decisions": np.int64,
    "scans": np.int64,
    "stop_reason": np.int64,
    "plan_index": np.int64,
    "simulation_seed": np.int64,
}
"""The entries of `info` that both environments have."""

_TRUNCATING = {"budget", "invalid_actions", "steps"}
_OPTIONS = {"plan", "start"}


class ExplorationEnv(gymnasium.Env[Observation, Action]):
    """One robot exploring one floor plan an episode; see `FrontierEnv` and `MotionEnv`.

    Attributes:
        simulation: The simulation of the current episode.
        stop_reason: Why the episode ended; "" while it goes on.
        progress: How far the training is, 0 ... 1, for a `PlanSampler`; a trainer may set it.
    """

    metadata: dict[str, Any] = {"render_modes": list(RENDER_MODES), "render_fps": 4}  # noqa: RUF012

    def __new__(cls, *arguments: Any, **options: Any) -> Self:
        """An environment that is still to be made, if there are such options.

        Raises:
            UnknownNameError: There is no such option; the closest ones are suggested.
        """
        check_options(cls, options)
        return super().__new__(cls)

    def __init__(
        self,
        plan: PlanSpec,
        config: SimulationConfig,
        *,
        randomisation: Randomisation | None,
        predictor: object,
        reward_function: str | Reward,
        viewer: Viewer,
        watches_rooms: bool = False,
    ) -> None:
        check_kind("randomisation", randomisation, Randomisation, optional=True)
        self.config = config
        self.render_mode = viewer.mode
        self.progress = 1.0
        self._randomisation = randomisation
        self._plans = PlanSource(plan)
        self._predictor = _predictor(predictor)
        self._reward = reward(reward_function)
        self._counts_visits = reads_rooms(self._reward)
        self._reads_foresight = self._predictor is not None and reads_foresight(self._reward)
        self._foreseen: Mask | None = None
        self._watches_rooms = watches_rooms or self._counts_visits
        self._ledger: RoomLedger | None = None
        self._viewer = viewer
        self._simulation: Simulation | None = None
        self._over = True

    @property
    def simulation(self) -> Simulation:
        """The simulation of the current episode."""
        if self._simulation is None:
            raise ResetNeeded("call reset() before anything else")
        return self._simulation

    @property
    def plan_name(self) -> str:
        """The name of the episode's floor plan; `envs.call("plan_name")` asks a vector environment."""
        return self.simulation.plan.name

    def render(self) -> Bytes | str | None:
        """A frame uint8 (height, width, 3), a text, or None, by the render mode."""
        if self.render_mode is None:
            gymnasium.logger.warn(
                "render() does nothing without a render_mode: gymnasium.make(id, render_mode='rgb_array')"
            )
            return None
        return self._viewer.draw(self.simulation)

    def close(self) -> None:
        """Close the window of the mode "human"."""
        self._viewer.close()

    def _begin(self, seed: int | None, options: Mapping[str, Any] | None) -> None:
        """Start an episode: draw the plan and the simulation's seed, and reset it."""
        options = {} if options is None else options
        check_keys(options, _OPTIONS, "the options of reset")
        self._over = True  # Where it fails, no episode goes on under the seed and the plan of this one.
        super().reset(seed=None if seed is None else SEED.convert("seed", seed))
        self._plan_index, plan = self._plans.draw(self.np_random, self.progress)
        if options.get("plan") is not None:
            check_kind('options["plan"]', options["plan"], FloorPlan, str, os.PathLike)
            self._plan_index, plan = -1, load(options["plan"])
        self._simulation_seed = int(self.np_random.integers(2**31))
        config = self._randomisation.draw(self.np_random, self.config) if self._randomisation else self.config
        if self._simulation is None or self._simulation.plan is not plan or self._simulation.config != config:
            self._simulation = Simulation(plan, config, self._predictor)
        self._simulation.reset(self._simulation_seed, _start(options.get("start")))
        self.stop_reason = ""
        self._over = False
        if self._watches_rooms:
            self._ledger = RoomLedger(self._simulation.truth)
            self._watch()
        self._remember()

    def _remember(self) -> None:
        """Keep what the reward of the next step is measured from."""
        simulation = self.simulation
        self._before = (simulation.distance, simulation.mapper.known_free, simulation.coverage)
        if self._reads_foresight:
            self._foreseen = None if self._over else hidden_floor(simulation.decision)

    def _finish(self) -> tuple[float, bool, bool]:
        """Reward, terminated and truncated of the step that has been made."""
        simulation = self.simulation
        self.stop_reason = self.stop_reason or simulation.stop_reason
        self._over = bool(self.stop_reason)
        distance, known_free, coverage = self._before
        finished = self._watch()
        transition = Transition(
            metres=simulation.distance - distance,
            new_area=(simulation.mapper.known_free - known_free) * simulation.raster.resolution**2,
            coverage=simulation.coverage,
            coverage_gain=simulation.coverage - coverage,
            distance=simulation.distance,
            budget=simulation.max_distance,
            stop_reason=self.stop_reason,
            metres_before_95=self._metres_before(NEARLY_SEEN),
            metres_before_99=self._metres_before(FULLY_SEEN),
            reference=0.2 * (100.0 + simulation.target_area),
            rooms_finished=finished,
            foreseen_area=came_true(self._foreseen, simulation.mapper.grid),
        )
        self._remember()
        truncated = self.stop_reason in _TRUNCATING
        return _number(self._reward(transition)), self._over and not truncated, truncated

    def _watch(self) -> int:
        """The rooms that were finished, if the reward reads them; the ledger, if any, notes what was seen."""
        if self._ledger is None:
            return 0
        simulation = self.simulation
        finished = self._ledger.update(
            simulation.unseen_in, simulation.robot.track if self._counts_visits else None
        )
        return finished if self._counts_visits else 0

    def _metres_before(self, threshold: float) -> float:
        """Metres of the last step, within the budget, before the coverage reached a threshold."""
        simulation = self.simulation
        distance, _, coverage = self._before
        if coverage >= threshold:
            return 0.0
        charged = min(simulation.distance, simulation.max_distance)
        if simulation.coverage < threshold:
            return charged - distance
        curve = simulation.curve
        return distance_to_coverage(curve[:, 0], curve[:, 1], threshold, budget=charged)[0] - distance

    @property
    def info_types(self) -> dict[str, NDArray[np.generic]]:
        """Every entry of `info` as a zero of its shape and dtype, for vector environments to make room."""
        return {name: np.zeros((), dtype) for name, dtype in _INFO.items()}

    def _check_running(self) -> None:
        if self._over:
            raise ResetNeeded(
                "the episode is over: call reset() before the next step()"
                if self._simulation
                else "call reset() first"
            )

    def _info(self) -> dict[str, Any]:
        """The entries of `info` that both environments have."""
        simulation = self.simulation
        return {
            "coverage": simulation.coverage,
            "distance": simulation.distance,
            "known_area": simulation.mapper.known_free * simulation.raster.resolution**2,
            "decisions": simulation.decisions,
            "scans": simulation.scans,
            "stop_reason": STOP_REASONS.index(self.stop_reason),
            "plan_index": self._plan_index,
            "simulation_seed": self._simulation_seed,
        }


def check_options(environment: type[Any], options: Mapping[str, Any], *more: str) -> None:
    """Raise `UnknownNameError` unless an environment has all of these options, or they are some of `more`."""
    parameters = list(signature_of(environment.__init__).parameters.values())[1:]
    if any(parameter.kind is parameter.VAR_KEYWORD for parameter in parameters):
        return
    known = [parameter.name for parameter in parameters]
    for name in options:
        if name not in known:
            raise unknown_name(f"option of {environment.__name__}", name, [*known, *more])


def whole_action(action: Any) -> int:
    """An action of a `Discrete` space; a flag or a fraction is none.

    Raises:
        ConfigError: It is no whole number.
    """
    try:
        if isinstance(action, (bool, np.bool_)) or getattr(action, "dtype", None) == np.bool_:
            raise TypeError
        return operator.index(action)
    except Exception:  # whatever an object raises that is asked for its number
        raise ConfigError(f"an action is a whole number, got {shortened(action)}") from None


def configure(simulation: SimulationConfig | None, **overrides: Any) -> SimulationConfig:
    """The configuration of an environment's simulations: overrides that are None change nothing."""
    check_kind("simulation", simulation, SimulationConfig, optional=True)
    changes = {name: value for name, value in overrides.items() if value is not None}
    return replace(simulation or SimulationConfig(), **changes)


def _predictor(given: object) -> Predictor | None:
    """What was given as a predictor, a name or what has `rooms(decision)` or `predict(decision)`, as one."""
    if given is None:
        return None
    from layoutexplore.predictors import make_predictor

    return make_predictor(given)


def _number(reward: object) -> float:
    """What a reward function has returned, which may be the user's own."""
    try:
        number = float(cast(Any, reward))
    except (TypeError, ValueError):
        number = math.nan
    if math.isnan(number):
        raise ConfigError(f"a reward function returns a number, got {shortened(reward)}") from None
    return number


def _start(value: Any) -> Pose | None:
    """A start from the options of `reset`: (x, y) or (x, y, theta)."""
    if value is None:
        return None
    try:
        numbers = tuple(float(v) for v in value) if len(value) in (2, 3) else ()
    except Exception:  # whatever an object raises that is asked for its numbers
        numbers = ()
    if len(numbers) not in (2, 3):
        raise StartError(f"a start is (x, y) or (x, y, theta), got {shortened(value)}")
    return Pose(*numbers)
