"""Which floor plans predictors learn from, and which moments they are evaluated at."""

from __future__ import annotations

import math

import pytest

from layoutexplore.agents import make_agent
from layoutexplore.maps.generator import generate
from layoutexplore.maps.tracing import floorplan_from_ascii
from layoutexplore.predictors.upright import outlined, wall_angle
from layoutexplore.training.explorations import PROTOCOL_AGENT, protocol_explorations, upright_plan
from layoutexplore.training.snapshots import explore_plan
from tests.plans import TWO_HALLS


@pytest.mark.parametrize("degrees", [-19.0, 12.0, 40.0])
def test_what_lies_askew_is_learnt_from_upright(degrees: float) -> None:
    plan = generate("office", 7)
    assert upright_plan(plan) is plan
    askew = plan.turned(math.radians(degrees))
    assert abs(math.degrees(wall_angle(outlined(askew.rasterize(0.1).free), 0.1))) > 9.0
    upright = upright_plan(askew)
    assert wall_angle(outlined(upright.rasterize(0.1).free), 0.1) == 0.0
    assert upright.rasterize(0.1).free.sum() == pytest.approx(plan.rasterize(0.1).free.sum(), rel=0.03)


def test_a_look_that_passes_several_shares_counts_once() -> None:
    plan = floorplan_from_ascii(TWO_HALLS, resolution=0.5, name="halls")
    every = explore_plan(plan, make_agent(PROTOCOL_AGENT), sensor="indoor", seed=0)
    (chosen,) = protocol_explorations(plan, make_agent, sensors=("indoor",))
    assert len({s.decision.grid.cells.tobytes() for s in every}) == len(chosen) < len(every)
    assert len({s.decision.grid.cells.tobytes() for s in chosen}) == len(chosen)
    last = {s.decision.grid.cells.tobytes(): s.coverage for s in every}
    assert [s.coverage for s in chosen] == list(last.values())
