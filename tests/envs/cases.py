"""The environments that the tests share: one small floor plan, every registered id, and seeded episodes."""

from __future__ import annotations

import hashlib
from typing import Any

import gymnasium
import numpy as np
import pytest

import layoutexplore  # noqa: F401  (registers the environments)
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.maps.tracing import floorplan_from_ascii
from tests.plans import SIX_ROOMS

FRONTIER, MOTION = "LayoutExplore/Frontier-v0", "LayoutExplore/Motion-v0"
IDS = sorted(name for name in gymnasium.registry if name.startswith("LayoutExplore/"))
CASES = [(name, {}) for name in IDS] + [(MOTION, {"actions": "continuous"})]
cases = pytest.mark.parametrize(("name", "options"), CASES, ids=lambda value: str(value))

Step = tuple[dict[str, np.ndarray], float, bool, bool, dict[str, Any]]


def rooms() -> FloorPlan:
    return floorplan_from_ascii(SIX_ROOMS, resolution=0.5, name="six-rooms")


def make(name: str, **options: Any) -> gymnasium.Env[Any, Any]:
    return gymnasium.make(name, **{"plan": rooms(), "sensor": "indoor"} | options)


def rollout(env: gymnasium.Env[Any, Any], seed: int | None, steps: int = 12) -> list[Step]:
    """Seeded random valid actions; a new episode begins where one ends."""
    observation, info = env.reset(seed=seed)
    rng = np.random.default_rng(seed)
    taken: list[Step] = [(observation, 0.0, False, False, info)]
    for _ in range(steps):
        taken.append(env.step(choose(env, taken[-1][4], rng)))
        if taken[-1][2] or taken[-1][3]:
            env.reset()
    return taken


def choose(env: gymnasium.Env[Any, Any], info: dict[str, Any], rng: np.random.Generator) -> Any:
    if "action_mask" in info:
        valid = np.flatnonzero(env.unwrapped.action_masks()[:-1])
        return rng.choice(valid) if len(valid) else env.action_space.n - 1
    if isinstance(env.action_space, gymnasium.spaces.Box):
        return rng.uniform(-1, 1, 2).astype(np.float32)
    return rng.choice([0, 0, 0, 1, 2])


def digest(steps: list[Step]) -> str:
    """A hash of everything that an environment returned."""
    total = hashlib.sha256()
    for observation, reward, terminated, truncated, info in steps:
        for key in sorted(observation):
            total.update(observation[key].tobytes())
        total.update(repr((reward, terminated, truncated)).encode())
        for key in sorted(info):
            total.update(np.asarray(info[key]).tobytes())
    return total.hexdigest()
