"""Throughput of vector environments: by who steps them, without and with the tour's features and a predictor.

Wall time, since worker processes are part of it. All vectors of a row group make the same decisions on the same plan, and take
turns; the fastest turn of each counts, so that a busy machine disturbs the ratios little.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AsyncVectorEnv, AutoresetMode, SyncVectorEnv, VectorEnv

from layoutexplore.envs.observation import ObservationConfig
from layoutexplore.processes import usable_cores
from layoutexplore.speed.floors import plan
from layoutexplore.speed.measurement import Row

_ID = "LayoutExplore/Frontier-v0"
_ENVIRONMENTS, _STEPS, _TURNS = 4, 10, 3
_MAPLESS: dict[str, Any] = {"local_map": False, "global_map": False}

_SETTINGS: tuple[tuple[str, dict[str, Any], float], ...] = (
    ("maps", {}, 0.0),
    ("no maps", {"observation": ObservationConfig(**_MAPLESS)}, 1000.0),
    ("no maps, tour", {"observation": ObservationConfig(**_MAPLESS, detour=True)}, 0.0),
    (
        "no maps, tour, prediction",
        {"observation": ObservationConfig(**_MAPLESS, detour=True), "predictor": "layout"},
        150.0,
    ),
)
"""Name, options and goal in decisions a second with all cores (0: none)."""


class _Racer:
    """A vector environment on its way: every turn goes on where the last one ended."""

    def __init__(self, env: VectorEnv[Any, Any, Any]) -> None:
        self._env, self._rng = env, np.random.default_rng(0)
        _, self._infos = env.reset(seed=0)
        self.best = np.inf

    def turn(self) -> None:
        """A few steps: mostly the nearest frontier, now and then one behind it."""
        start = time.perf_counter()
        for _ in range(_STEPS):
            last = np.maximum(self._infos["frontier_count"] - 1, 0)
            *_, self._infos = self._env.step(np.minimum(self._rng.geometric(0.5, _ENVIRONMENTS) - 1, last))
        self.best = min(self.best, time.perf_counter() - start)

    @property
    def rate(self) -> float:
        """Decisions a second."""
        return _STEPS * _ENVIRONMENTS / self.best


def vector_steps() -> Iterator[Row]:
    """Decisions a second of every backend beside Gymnasium's vectors of the same environment."""
    for name, options, goal in _SETTINGS:
        yield from _race(name, {"plan": plan()} | options, goal)


def _race(name: str, options: dict[str, Any], goal: float) -> Iterator[Row]:
    def single() -> gymnasium.Env[Any, Any]:
        return gymnasium.make(_ID, **options)

    makers = [single] * _ENVIRONMENTS
    cores = usable_cores()
    own: list[tuple[str, dict[str, Any]]] = [("1 thread", {"backend": "serial"})]
    own.append((f"{cores} threads", {"backend": "threads", "workers": cores}))
    own += [(f"{n} processes", {"backend": "processes", "workers": n}) for n in sorted({1, cores})]
    racers: dict[str, _Racer] = {}
    envs: list[VectorEnv[Any, Any, Any]] = []
    try:
        envs.append(SyncVectorEnv(makers, autoreset_mode=AutoresetMode.SAME_STEP))
        envs.append(AsyncVectorEnv(makers, autoreset_mode=AutoresetMode.SAME_STEP, context="spawn"))
        envs += [gymnasium.make_vec(_ID, num_envs=_ENVIRONMENTS, **options, **backend) for _, backend in own]
        names = ["SyncVectorEnv", "AsyncVectorEnv", *(label for label, _ in own)]
        racers = {label: _Racer(env) for label, env in zip(names, envs, strict=True)}
        for _ in range(_TURNS):
            for racer in racers.values():
                racer.turn()
    finally:
        for env in envs:
            env.close()
    for label, _ in own:
        reference = "AsyncVectorEnv" if "processes" in label else "SyncVectorEnv"
        ours, theirs = racers[label].rate, racers[reference].rate
        last = goal > 0 and label == own[-1][0]
        yield Row(
            name=f"vector, {name}, {label}",
            ours=ours,
            unit="decisions/s",
            reference=theirs,
            reference_name=reference,
            ratio=ours / theirs,
            goal=f">= {goal:.0f} on 2 cores" if last else "",
            reached=ours / goal if last else None,
        )
