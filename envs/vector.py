"""Many environments at once: what `gymnasium.make_vec("LayoutExplore/Frontier-v0", num_envs=N)` makes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import deepcopy
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
from gymnasium.error import ClosedEnvironmentError, ResetNeeded
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from layoutexplore.envs.base import ExplorationEnv, check_options
from layoutexplore.envs.frontier import FrontierEnv
from layoutexplore.envs.motion import MotionEnv
from layoutexplore.envs.observation import Observation
from layoutexplore.envs.vector_buffers import Arrays
from layoutexplore.envs.vector_workers import LocalWorkers, ProcessWorkers, Workers, WorkerSetup
from layoutexplore.errors import ConfigError, cause, checks_making, shortened, unknown_name
from layoutexplore.grids.arrays import Floats, Mask
from layoutexplore.options import COUNT, FLAG, SEED, Rule, check_kind
from layoutexplore.processes import usable_cores

MOST_ENVIRONMENTS = 65_536
"""So many environments a vector may hold; memory ends it sooner."""

BACKENDS = ("serial", "threads", "processes")
"""Who steps the environments: this thread, a few threads, or worker processes."""

_OWN_OPTIONS = ("backend", "workers", "autoreset_mode", "max_episode_steps", "copy")

Step = tuple[Observation, Floats, Mask, Mask, dict[str, Any]]


class ExplorationVectorEnv(VectorEnv[Observation, Any, NDArray[Any]]):
    """N independent environments, stepped together; the trajectories of N single ones with the same seeds.

    Observations, rewards and infos are written into arrays that are made once; with worker processes these
    lie in shared memory, so that only a few bytes travel per step. Floor plans, their rasters and the
    sensor's tables are shared by all environments of a process.

    Args:
        num_envs: How many.
        backend: One of `BACKENDS`; None takes processes when there is more than one core and more than one
            environment.
        workers: Threads or processes; None for as many as there are cores, at most one per environment.
        autoreset_mode: When the next episode begins: `AutoresetMode` or its value. With "SameStep" (the
            default, what adapters for stable-baselines3 need) in the step that ends one, whose last
            observation and info are then `info["final_obs"]` and `info["final_info"]`; with "NextStep" in the
            step after, whose action counts for nothing; with "Disabled" when `reset(options={"reset_mask":
            mask})` is called.
        max_episode_steps: Steps after which an episode is truncated.
        copy: Whether observations are copies. Without, `reset` and `step` return the arrays themselves, which
            the next step overwrites.
        **options: Of each environment; see its class.

    Raises:
        ConfigError: An option makes no sense.
    """

    environment: type[ExplorationEnv[Any]]

    def __init__(
        self,
        num_envs: int = 1,
        *,
        backend: str | None = None,
        workers: int | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.SAME_STEP,
        max_episode_steps: int | None = None,
        copy: bool = True,
        **options: Any,
    ) -> None:
        self.closed = True  # Until all went well: a failed constructor leaves nothing to close.
        FLAG.convert("copy", copy)
        check_options(self.environment, options, *_OWN_OPTIONS)
        make = partial(_make, self.environment, options)
        template = make()
        self.num_envs, self._mode, self._copy = num_envs, _checked_mode(autoreset_mode), copy
        groups, backend = _grouped(num_envs, backend, workers)
        COUNT.convert("max_episode_steps", 1 if max_episode_steps is None else max_episode_steps)
        setup = WorkerSetup(make, template, groups, self._mode, max_episode_steps)
        self._made: Workers = (
            ProcessWorkers(setup)
            if backend == "processes"
            else LocalWorkers(setup, threads=backend == "threads")
        )
        self.closed = False
        self.metadata = template.metadata | {"autoreset_mode": self._mode}
        self.autoreset_mode = self._mode
        self.render_mode = template.render_mode
        self.single_observation_space = template.observation_space
        self.single_action_space = template.action_space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode in every environment.

        Args:
            seed: One for each environment, or the first of consecutive ones.
            options: For each environment; `reset_mask`, bool (num_envs,), chooses the environments to reset.
        """
        seed = seed.tolist() if isinstance(seed, np.ndarray) else seed
        if seed is None:
            seeds: list[int | None] = [None] * self.num_envs
        elif isinstance(seed, (list, tuple)):
            seeds = [None if one is None else SEED.convert("seed", one) for one in seed]
        else:
            seeds = [SEED.convert("seed", seed) + k for k in range(self.num_envs)]
        if len(seeds) != self.num_envs:
            raise ConfigError(f"{self.num_envs} environments need as many seeds, got {len(seeds)}")
        check_kind("options", options, Mapping, optional=True)
        options = dict(options or {})
        chosen = _checked_mask(options.pop("reset_mask", None), self.num_envs)
        self._command("reset", [(seeds[a:b], options, chosen[a:b]) for a, b in self.groups])
        buffers = self._workers.buffers
        return self._shown(buffers.observation), _batched(buffers.info, chosen)

    def step(self, actions: Any) -> Step:
        """One action for each environment.

        Returns:
            Observations by key (num_envs, ...), rewards float64 (num_envs,), terminated and truncated bool
            (num_envs,), infos by key (num_envs, ...), each with a mask of the environments that have it under
            "_" + key.
        """
        self.step_async(actions)
        return self.step_wait()

    def step_async(self, actions: Any) -> None:
        """Send the actions; with threads or processes the environments step meanwhile."""
        buffers = self._workers.buffers
        over = buffers.flags["terminated"] | buffers.flags["truncated"]
        if self._mode == AutoresetMode.DISABLED and over.any():
            raise ResetNeeded(
                "an episode is over and nothing resets it by itself: reset(options={'reset_mask': ...})"
            )
        _put_actions(buffers.actions, actions)
        self._workers.start("step", [()] * len(self.groups))

    def step_wait(self) -> Step:
        """The results of the step that was sent last."""
        self._workers.wait()
        return self._results(0, self.num_envs)

    @property
    def groups(self) -> Sequence[tuple[int, int]]:
        """Half-open ranges of environments, one for each thread or process that steps them."""
        return self._workers.groups

    def send(self, actions: NDArray[Any], group: int) -> None:
        """Step the environments of one group; no group waits for another, `receive` names one that is done.

        Args:
            actions: One for each environment of the group.
            group: Which of `groups`; it must have been received since it was sent last.
        """
        begin, end = self.groups[group]
        _put_actions(self._workers.buffers.actions[begin:end], actions)
        self._workers.start_one(group, "step", ())

    def receive(self) -> tuple[int, Step]:
        """A group that was sent and is done, and its step: as of `step`, a row for each environment."""
        group = self._workers.wait_one()
        return group, self._results(*self.groups[group])

    def _results(self, begin: int, end: int) -> Step:
        """What the last step of some environments left in the buffers."""
        buffers = self._workers.buffers.rows(begin, end)
        flags = {name: flag.copy() for name, flag in buffers.flags.items()}
        infos: dict[str, Any] = {}
        over = flags["terminated"] | flags["truncated"]
        if self._mode == AutoresetMode.SAME_STEP and over.any():
            final = np.full(end - begin, None, object)
            for k in np.flatnonzero(over).tolist():
                final[k] = {name: array[k].copy() for name, array in buffers.final_observation.items()}
            infos |= {"final_obs": final, "_final_obs": over.copy()}
            infos |= {"final_info": _batched(buffers.final_info, over), "_final_info": over.copy()}
        infos |= _batched(buffers.info, np.ones(end - begin, np.bool_))
        observation = self._shown(buffers.observation)
        return observation, flags["reward"], flags["terminated"], flags["truncated"], infos

    def action_masks(self) -> Mask:
        """Which actions are valid, bool (num_envs, actions), for `Frontier-v0`."""
        return np.asarray(self._workers.buffers.observation["action_mask"], np.bool_)

    def render(self) -> tuple[Any, ...]:
        """A frame of each environment, as its render mode says."""
        return self.call("render")

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """An attribute of each environment, or the result of calling it."""
        check_kind("the name of an attribute", name, str)
        answers = self._command("call", [(name, args, kwargs)] * len(self.groups))
        return tuple(value for answer in answers for value in answer)

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """An attribute of each environment."""
        return self.call(name)

    def set_attr(self, name: str, values: Any) -> None:
        """Set an attribute: a list or tuple holds a value for each environment, anything else is for all."""
        check_kind("the name of an attribute", name, str)
        each = list(values) if isinstance(values, (list, tuple)) else [values] * self.num_envs
        if len(each) != self.num_envs:
            raise ConfigError(f"{self.num_envs} environments need as many values, got {len(each)}")
        self._command("set_attr", [(name, each[a:b]) for a, b in self.groups])

    @property
    def np_random_seed(self) -> tuple[int, ...]:  # type: ignore[override]
        """The seed of each environment."""
        return self.get_attr("np_random_seed")

    @property  # type: ignore[misc]
    def np_random(self) -> tuple[np.random.Generator, ...]:  # type: ignore[override]
        """The generator of each environment; a copy where it lives in another process."""
        return self.get_attr("np_random")

    def close_extras(self, **kwargs: Any) -> None:
        """End the workers; afterwards no process and no shared memory is left."""
        self._made.close()

    @property
    def _workers(self) -> Workers:
        """Who steps the environments: nobody any more once they are closed, or have ended by themselves."""
        if self.closed or self._made.ended:
            raise ClosedEnvironmentError(
                f"this {type(self).__name__} of {self.num_envs} environments is closed: make a new one"
            )
        return self._made

    def _command(self, command: str, arguments: Sequence[tuple[Any, ...]]) -> list[Any]:
        self._workers.start(command, arguments)
        return self._workers.wait()

    def _shown(self, observation: Arrays) -> Observation:
        return {key: array.copy() if self._copy else array for key, array in observation.items()}


@checks_making
class FrontierVectorEnv(ExplorationVectorEnv):
    """Many `FrontierEnv`; see `ExplorationVectorEnv`."""

    environment = FrontierEnv


@checks_making
class MotionVectorEnv(ExplorationVectorEnv):
    """Many `MotionEnv`; see `ExplorationVectorEnv`."""

    environment = MotionEnv


def _make(environment: type[ExplorationEnv[Any]], options: dict[str, Any]) -> ExplorationEnv[Any]:
    """One of the environments; each has a predictor of its own, since a predictor may remember its run."""
    if "predictor" in options:
        options = options | {"predictor": deepcopy(options["predictor"])}
    return environment(**options)


def _grouped(count: int, backend: str | None, workers: int | None) -> tuple[Sequence[tuple[int, int]], str]:
    """Half-open ranges of environments, one for each worker, and the backend."""
    Rule(kind=int, low=1, high=MOST_ENVIRONMENTS).convert("num_envs", count)
    Rule(kind=int, low=1, high=1024).convert("workers", 1 if workers is None else workers)
    available = usable_cores() if workers is None else workers
    if backend is None:
        backend = "processes" if count > 1 and available > 1 else "serial"
    if not isinstance(backend, str) or backend not in BACKENDS:
        raise unknown_name("backend", backend, BACKENDS)
    bounds = np.linspace(0, count, 1 + (1 if backend == "serial" else min(count, available)))
    return list(pairwise(bounds.round().astype(int).tolist())), backend


def _checked_mode(mode: AutoresetMode | str) -> AutoresetMode:
    try:
        return AutoresetMode(mode)
    except ValueError:
        raise unknown_name("autoreset mode", str(mode), [known.value for known in AutoresetMode]) from None


def _put_actions(buffer: NDArray[Any], actions: Any) -> None:
    """Fill a buffer (k, ...) with the actions of k environments; a fraction or a flag is no whole number."""
    try:
        given = np.asarray(actions)
    except Exception as error:  # whatever an object raises that is asked for its numbers
        raise ConfigError(f"actions are an array {buffer.shape} of numbers: {cause(error)}") from error
    if given.shape != buffer.shape:
        raise ConfigError(
            f"the actions of {len(buffer)} environments have shape {buffer.shape}, got {given.shape}"
        )
    if given.dtype.kind not in ("iu" if buffer.dtype.kind in "iu" else "iuf"):
        raise ConfigError(f"actions are numbers of type {buffer.dtype}, got {shortened(actions)}")
    buffer[...] = given


def _checked_mask(mask: Any, count: int) -> Mask:
    """Which environments to reset: all without a mask."""
    if mask is None:
        return np.ones(count, np.bool_)
    if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_ or mask.shape != (count,) or not mask.any():
        raise ConfigError(
            f"reset_mask is a bool array ({count},) that chooses at least one environment, "
            f"got {shortened(mask)}"
        )
    return mask


def _batched(info: Arrays, chosen: Mask) -> dict[str, Any]:
    """Infos as Gymnasium batches them: zeros where an environment has none, and a mask under "_" + key."""
    batched: dict[str, Any] = {}
    for key, array in info.items():
        batched[key] = array.copy()
        batched[key][~chosen] = 0
        batched["_" + key] = chosen.copy()
    return batched
