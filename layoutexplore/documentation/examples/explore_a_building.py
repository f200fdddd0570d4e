"""Explore one building with one strategy, print the way there, and draw the rooms believed at the end."""

import cv2

from layoutexplore import Simulation, SimulationConfig, draw_layout, make_agent
from layoutexplore.predictors import make_predictor

if __name__ == "__main__":
    predictor = make_predictor("layout")
    simulation = Simulation("apartment:3", SimulationConfig(sensor="indoor"), predictor=predictor)
    agent = make_agent("layout-tour")
    agent.reset(seed=0)
    decision = simulation.reset(seed=0)
    while not simulation.done:
        closed = sum(frontier.is_closed is True for frontier in decision.frontiers)
        last = decision
        print(
            f"{simulation.coverage:6.1%} {decision.distance:5.1f} m:",
            f"{len(decision.frontiers)} frontiers, {closed} of them closed",
        )
        decision = simulation.step(agent.act(decision))
    print(f"{simulation.coverage:6.1%} {simulation.distance:5.1f} m")
    if last.rooms is not None:
        cv2.imwrite("rooms.png", draw_layout(last.rooms.layout, last.grid)[..., ::-1])
