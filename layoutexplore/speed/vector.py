"""Throughput of vector environments by backend, on plans of three sizes, with and without a predictor.

Wall time, since worker processes are part of it. All vectors of a row group play the same stretch of the same
episodes again and again, taking turns; the fastest turn of each counts, so that a busy machine disturbs the
ratios little.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AsyncVectorEnv, AutoresetMode, SyncVectorEnv, VectorEnv

from layoutexplore.envs.observation import ObservationConfig
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.processes import usable_cores
from layoutexplore.speed.floors import plan_of
from layoutexplore.speed.measurement import SpeedRow

AREAS = (1000.0, 1750.0, 2350.0)
"""Floor areas in square metres that plans are asked for.

The one in the middle is the one that all backends run on.
"""

CORES = 2
"""Goals are meant for so many: fewer may miss them."""

_ID = "LayoutExplore/Frontier-v0"
_ENVIRONMENTS, _TURNS = 8, 2
_MAPLESS: dict[str, Any] = {"local_map": False, "global_map": False}


@dataclass(frozen=True)
class _Setting:
    """Options of an environment, steps of a turn, the goal in decisions a second on all cores (0: none)."""

    name: str
    options: dict[str, Any]
    steps: int
    goal: float = 0.0


_SETTINGS = (
    _Setting("maps", {}, 50),
    _Setting("no maps", {"observation": ObservationConfig(**_MAPLESS)}, 150, 1000.0),
    _Setting("no maps, tour", {"observation": ObservationConfig(**_MAPLESS, detour=True)}, 50),
    _Setting(
        "no maps, tour, prediction",
        {"observation": ObservationConfig(**_MAPLESS, detour=True), "predictor": "layout"},
        50,
        150.0,
    ),
)


class _Racer:
    """A vector environment that plays the same steps every turn."""

    def __init__(self, env: VectorEnv[Any, Any, Any], steps: int) -> None:
        self._env, self._steps, self.best = env, steps, np.inf

    def turn(self) -> None:
        """The first steps of the same episodes.

        Mostly to the nearest frontier, now and then to one behind it.
        """
        rng = np.random.default_rng(0)
        _, infos = self._env.reset(seed=0)
        start = time.perf_counter()
        for _ in range(self._steps):
            last = np.maximum(infos["frontier_count"] - 1, 0)
            *_, infos = self._env.step(np.minimum(rng.geometric(0.5, _ENVIRONMENTS) - 1, last))
        self.best = min(self.best, time.perf_counter() - start)

    @property
    def rate(self) -> float:
        """Decisions a second."""
        return self._steps * _ENVIRONMENTS / self.best


def vector_steps() -> Iterator[SpeedRow]:
    """Decisions a second: every backend beside Gymnasium's vectors on one plan, processes on all plans."""
    for setting in _SETTINGS:
        for area in AREAS:
            if area == AREAS[1]:
                yield from _race(setting, plan_of(area), everybody=True)
            elif setting.goal:
                yield from _race(setting, plan_of(area), everybody=False)


def _race(setting: _Setting, plan: FloorPlan, *, everybody: bool) -> Iterator[SpeedRow]:
    cores = usable_cores()
    own: dict[str, dict[str, Any]] = {}
    if everybody:
        own = {
            "1 thread": {"backend": "serial"},
            f"{cores} threads": {"backend": "threads", "workers": cores},
        }
    own |= {_processes(n): {"backend": "processes", "workers": n} for n in sorted({1, cores})}
    rates = _rates(setting, {"plan": plan} | setting.options, own, references=everybody)
    for label in own:
        reference = "" if not everybody else "AsyncVectorEnv" if "process" in label else "SyncVectorEnv"
        last = setting.goal > 0 and label == _processes(cores) and cores >= CORES
        yield SpeedRow(
            name=f"vector, {setting.name}, {plan.area:.0f} m2, {label}",
            ours=rates[label],
            unit="decisions/s",
            reference=rates[reference] if reference else None,
            reference_name=reference,
            goal=f">= {setting.goal:.0f} on {CORES} cores" if last else "",
            reached=rates[label] / setting.goal if last else None,
        )


def _processes(count: int) -> str:
    return f"{count} process" if count == 1 else f"{count} processes"


def _rates(
    setting: _Setting, options: dict[str, Any], own: dict[str, dict[str, Any]], *, references: bool
) -> dict[str, float]:
    """Decisions a second of vectors by name: Gymnasium's, if asked for, and our own with their options."""

    def single() -> gymnasium.Env[Any, Any]:
        return gymnasium.make(_ID, **options)

    makers: dict[str, Callable[[], VectorEnv[Any, Any, Any]]] = {}
    if references:
        singles, mode = [single] * _ENVIRONMENTS, AutoresetMode.SAME_STEP
        makers["SyncVectorEnv"] = lambda: SyncVectorEnv(singles, autoreset_mode=mode)
        makers["AsyncVectorEnv"] = lambda: AsyncVectorEnv(singles, autoreset_mode=mode, context="spawn")
    for label, backend in own.items():
        makers[label] = partial(gymnasium.make_vec, _ID, num_envs=_ENVIRONMENTS, **options, **backend)
    envs: dict[str, VectorEnv[Any, Any, Any]] = {}
    try:
        for label, make in makers.items():
            envs[label] = make()
        racers = {label: _Racer(env, setting.steps) for label, env in envs.items()}
        for _ in range(_TURNS):
            for racer in racers.values():
                racer.turn()
    finally:
        for env in envs.values():
            env.close()
    return {label: racer.rate for label, racer in racers.items()}
