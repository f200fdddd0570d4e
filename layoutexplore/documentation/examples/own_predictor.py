"""A predictor of rooms of your own, in the loop: it decides where `layout-tour` goes."""

import gymnasium

from layoutexplore import Simulation, SimulationConfig, make_agent
from layoutexplore.frontiers.decision import Decision
from layoutexplore.grids.arrays import Ints32
from layoutexplore.grids.grid import UNKNOWN
from layoutexplore.layout.doorways import doorway_regions
from layoutexplore.predictors import make_predictor
from layoutexplore.simulation.episode import play


class BoxRooms:
    """A room is the box around what is seen of it, and a little more."""

    def __init__(self, margin: float = 0.5) -> None:
        self.margin = margin  # metres

    def rooms(self, decision: Decision) -> Ints32:
        """int32 (rows, cols): the room of each cell, seen or not, 0 for none."""
        cells = decision.grid.cells
        regions = doorway_regions(cells, decision.grid.resolution)
        rooms, wider = regions.labels.copy(), round(self.margin / decision.grid.resolution)
        for room, (_, row0, col0, row1, col1) in enumerate(regions.boxes.tolist()[1:], start=1):
            box = slice(max(row0 - wider, 0), row1 + wider), slice(max(col0 - wider, 0), col1 + wider)
            rooms[box][(cells[box] == UNKNOWN) & (rooms[box] == 0)] = room
        return rooms


if __name__ == "__main__":
    for name, predictor in (("none", None), ("BoxRooms", make_predictor(BoxRooms()))):
        simulation = Simulation("apartment:2", SimulationConfig(sensor="indoor"), predictor)
        play(simulation, make_agent("layout-tour"), seed=0)
        print(f"{name}: {simulation.coverage:.1%} seen in {simulation.distance:.0f} m")
    env = gymnasium.make("LayoutExplore/Frontier-v0", plan="apartment:2", predictor=f"{__file__}:BoxRooms")
    observation, info = env.reset(seed=0)
    print("closed frontiers for a policy:", observation["frontiers"].shape)
