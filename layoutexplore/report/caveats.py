"""What the results of a benchmark do not say, as far as it follows from how they were made."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from layoutexplore.agents import make_agent
from layoutexplore.benchmark.analysis import agents_of, cells_of_agents
from layoutexplore.benchmark.rows import CellKey, Row
from layoutexplore.errors import LayoutExploreError
from layoutexplore.frontiers.decision import predictor_of
from layoutexplore.maps import splits
from layoutexplore.report.templates import percent


def caveats(
    rows: Sequence[Row], settings: dict[str, Any], candidates: int = 1, baseline: str = "", planned: int = 0
) -> list[str]:
    """What these results do not say, as far as it follows from how they were made.

    Args:
        rows: All runs.
        settings: Of the benchmark.
        candidates: Number of agents of which the best one is named at the top.
        baseline: The agent that all are compared with.
        planned: Number of runs that floor plans, starts, sensors and agents make; 0 where nobody knows.
    """
    return [*_of_cells(rows, baseline, planned), *_of_sampling(rows, candidates), *_of_simulation(settings)]


def _of_cells(rows: Sequence[Row], baseline: str, planned: int) -> list[str]:
    """What follows from runs that are not there, or failed."""
    there, cells = len({row.key for row in rows}), cells_of_agents(rows)
    every = set[CellKey]().union(*cells.values())
    said = []
    if there < planned:
        said.append(
            f"{there} of {planned} runs are there (floor plans x starts x sensors x agents in run.toml): the "
            "benchmark was not finished, or was added to in parts."
        )
    short: dict[int, list[str]] = {}
    for agent, mine in cells.items():
        if len(mine) < len(every):
            short.setdefault(len(mine), []).append(agent)
    for count, agents in sorted(short.items(), reverse=True):
        names, one = ", ".join(sorted(agents)), len(agents) == 1
        if not count:
            said.append(f"{names} failed in every cell and {'is' if one else 'are'} in no table.")
            continue
        whose = "all" if baseline in agents else "its" if one else "their"
        said.append(f"{names} ran {count} of the {len(every)} cells: {whose} ratios are of those.")
    return said


def _of_sampling(rows: Sequence[Row], candidates: int) -> list[str]:
    """What follows from the runs that were made."""
    buildings = len({row.cluster for row in rows if not row.error})
    said = []
    if 0 < buildings < 10:
        said.append(
            "Intervals resample buildings, and there "
            + (
                "is only one: there are no intervals at all."
                if buildings == 1
                else f"are only {buildings}: they are rough. Twenty buildings tell 5 % apart."
            )
        )
    if candidates > 1:
        said.append(
            f"The agent at the top is the best of {candidates} on these very runs: expect a little less on "
            "other floors."
        )
    if any(map(_has_learnt, agents_of(rows))):
        known = sorted({row.plan for row in rows} & set(splits().get("train", ())))
        said.append(
            "The room predictor that ships has learnt from the KTH and school floors and from the plans of "
            "the split train"
            + (f" ({', '.join(known)} here)" if known else "")
            + ", and half of its trees for frontiers from floors of MIT: there, agents that use it look "
            "better than in a new building."
        )
    return said


def _of_simulation(settings: dict[str, Any]) -> list[str]:
    """What follows from how robot, sensor and building are simulated."""
    simulation = settings["simulation"]
    noise = simulation.get("odometry_noise", {})
    clean = not any(lidar["range_noise_std"] or lidar["dropout"] for lidar in settings["lidars"].values())
    said = []
    if not any(noise.values()):
        said.append("Odometry is perfect: the robot always knows where it is, and the map never bends.")
    if clean:
        said.append("The lidar measures without noise and sees every surface, glass included.")
    if not simulation["turn_cost"]:
        said.append("Turning on the spot is free; time is not measured, only metres.")
    most = simulation.get("max_distance")
    budget = "100 m + 1 m per m² of target area" if most is None else f"{most:g} m"
    said.append(f"A run is ended after {budget}; a level not reached is charged that many metres.")
    goal = percent(simulation["coverage_goal"])
    said.append(
        f"Runs end at {goal} of the target area: what it would cost to see the rest was not measured."
    )
    said.append(
        "ms per decision is the agent's choice and its layout prediction, without mapping and frontiers; "
        "it varies by machine."
    )
    said.append(
        "Nothing moves in these buildings, doors stay as they are, and there is one robot on one floor."
    )
    return said


def _has_learnt(agent: str) -> bool:
    """Whether an agent asks the room predictor that ships; not one that this version cannot make."""
    try:
        return predictor_of(make_agent(agent)) == "layout"
    except LayoutExploreError:
        return False
