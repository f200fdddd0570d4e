"""Which floor plans predictors learn from."""

from __future__ import annotations

import math

import pytest

from layoutexplore.maps.generator import generate
from layoutexplore.predictors.upright import outlined, wall_angle
from layoutexplore.training.explorations import upright_plan


@pytest.mark.parametrize("degrees", [-19.0, 12.0, 40.0])
def test_what_lies_askew_is_learnt_from_upright(degrees: float) -> None:
    plan = generate("office", 7)
    assert upright_plan(plan) is plan
    askew = plan.turned(math.radians(degrees))
    assert abs(math.degrees(wall_angle(outlined(askew.rasterize(0.1).free), 0.1))) > 9.0
    upright = upright_plan(askew)
    assert wall_angle(outlined(upright.rasterize(0.1).free), 0.1) == 0.0
    assert upright.rasterize(0.1).free.sum() == pytest.approx(plan.rasterize(0.1).free.sum(), rel=0.03)
