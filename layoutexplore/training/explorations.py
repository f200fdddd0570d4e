"""The explorations that the predictor `layout` is trained and tested on.

What is left unseen depends on who explores, so several strategies do. They are made by the caller, who knows
the agents.
"""

from __future__ import annotations

import dataclasses
import itertools
import zlib
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from layoutexplore.frontiers.decision import Agent
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.predictors.snapshot import Snapshot
from layoutexplore.predictors.upright import outlined, wall_angle
from layoutexplore.training.snapshots import explore_plan

PROTOCOL_AGENT = "nearest"
"""Who explores where half-seen rooms are evaluated."""

AGENTS = (PROTOCOL_AGENT, "layout-tour:predictor=oracle", "layout-tour:area=4,predictor=oracle", "wait-8")
"""Of these one explores where predictors learn."""

SENSORS = ("stage", "indoor")

FIRST_SEED = 1000
"""Of the starts, so that they are others than those of evaluations."""

COVERAGES = (0.04, 0.985)
"""Between these shares of coverage explorations are stopped."""

STRETCH = 0.12
"""Copies of a plan are larger or smaller, and longer or wider, by up to this (as logarithms of factors)."""

_RESOLUTION = 0.1
"""Metres a cell of the raster by which it is seen whether a plan lies askew."""

MakeAgent = Callable[[str], Agent]
"""Makes the agent of a name, as `layoutexplore.agents.make_agent` does."""


def protocol_explorations(
    plan: FloorPlan,
    make_agent: MakeAgent,
    store: Path | None = None,
    *,
    sensors: Sequence[str] = SENSORS,
    starts: int = 1,
    noise: str = "",
) -> Iterator[list[Snapshot]]:
    """The explorations by which half-seen rooms are evaluated, by each sensor; stored ones are read.

    A look that passes several shares of coverage at once counts once, at the highest of them.
    """
    for sensor in sensors:
        for seed in range(starts):
            found = explore_plan(
                plan, make_agent(PROTOCOL_AGENT), sensor=sensor, seed=seed, store=store, noise=noise
            )
            grids = [snapshot.decision.grid.cells for snapshot in found]
            passed = [np.array_equal(*pair) for pair in itertools.pairwise(grids)]
            yield [snapshot for snapshot, again in zip(found, [*passed, False], strict=False) if not again]


def stopped_explorations(
    plan: FloorPlan, make_agent: MakeAgent, starts: int, snapshots: int, store: Path | None = None
) -> Iterator[list[Snapshot]]:
    """Explorations of a plan by each sensor, stopped here and there; stored ones are read.

    Args:
        plan: The floor plan.
        make_agent: Makes an agent by its name.
        starts: Explorations by each sensor.
        snapshots: Decisions kept of each.
        store: Folder in which explorations are kept.
    """
    for start in range(starts):
        for k, sensor in enumerate(SENSORS):
            rng = np.random.default_rng([zlib.crc32(plan.content_hash.encode()), k, start])
            agent = make_agent(AGENTS[int(rng.integers(len(AGENTS)))])
            shares = np.sort(rng.uniform(*COVERAGES, snapshots)).tolist()
            yield explore_plan(
                plan, agent, sensor=sensor, seed=FIRST_SEED + start, coverages=shares, store=store
            )


def stretched_copies(plan: FloorPlan, copies: int) -> Iterator[FloorPlan]:
    """Copies of a plan of other sizes and proportions, always the same ones: more buildings to learn from."""
    for copy in range(copies):
        rng = np.random.default_rng([zlib.crc32(plan.content_hash.encode()), copy])
        size, proportion = np.exp(rng.uniform(-STRETCH, STRETCH, 2)).tolist()
        stretched = plan.stretched(size * proportion, size / proportion)
        yield dataclasses.replace(stretched, name=f"{plan.name}-stretched-{copy + 1}")


def upright_plan(plan: FloorPlan) -> FloorPlan:
    """A plan with its walls along x and y, as predictors look at maps of it (`predictors.upright`).

    A plan that is upright, or that was born as an image, is returned as it is.
    """
    if plan.source is not None:
        return plan
    angle = wall_angle(outlined(plan.rasterize(_RESOLUTION).free), _RESOLUTION)
    return plan.turned(-angle) if angle else plan
