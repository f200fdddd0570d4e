"""A robot explores with the picture of an evacuation plan: the plan on the left, its way on the right."""

from pathlib import Path

import numpy as np

from layoutexplore import Simulation, SimulationConfig, load_plan, make_agent
from layoutexplore.drawing.prior_plans import draw_registered, side_by_side
from layoutexplore.grids.ros_map import encode_png
from layoutexplore.predictors.prior_plan import PriorPredictor
from layoutexplore.priors.evacuation_picture import draw_evacuation_plan
from layoutexplore.priors.presets import PRESETS
from layoutexplore.priors.reading import prior_of_picture
from layoutexplore.priors.spoiling import spoil

SHOWN = 0.4
"""The share of the floor that has been seen when the picture is made."""

if __name__ == "__main__":
    # A plan with wrong scales, rooms gone or elsewhere, a third of the doors missing; hung on a wall.
    floor, rng = load_plan("office-01"), np.random.default_rng(4)
    bad = spoil(floor, PRESETS["rough"], rng)
    sheet = draw_evacuation_plan(bad.free, bad.room_ids, bad.resolution, rng)
    predictor = PriorPredictor(prior_of_picture(sheet, name="sheet").prior)

    simulation = Simulation(floor, SimulationConfig(sensor="indoor"), predictor)
    agent = make_agent("plan-tour:predictor=none")
    decision = simulation.reset(seed=1)
    agent.reset(1)
    while not simulation.done and simulation.coverage < SHOWN:
        decision = simulation.step(agent.act(decision))
    assert predictor.registration is not None
    way = draw_registered(
        decision.grid, predictor.registration, predictor.confidence, simulation.track, scale=2
    )
    Path("plan-and-way.png").write_bytes(encode_png(side_by_side(sheet, way)))
    print(f"{simulation.coverage:.0%} seen, the plan is believed by {predictor.confidence:.0%}")
