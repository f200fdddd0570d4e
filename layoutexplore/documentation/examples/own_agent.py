"""An agent of your own beside two that ship, on the same floors from the same starts."""

from pathlib import Path

from layoutexplore.benchmark.analysis import compare
from layoutexplore.benchmark.config import BenchmarkConfig
from layoutexplore.benchmark.runner import run_benchmark
from layoutexplore.frontiers.decision import STOP, Decision


class LargestNearby:
    """The frontier with most unknown area in sight, of those not much farther than the nearest."""

    def __init__(self, patience: float = 3.0) -> None:
        self.patience = patience  # metres

    def reset(self, seed: int) -> None:
        """Nothing to forget."""

    def act(self, decision: Decision) -> int:
        """An index into the frontiers, which are sorted by path length."""
        limit = self.patience + min((f.path_length for f in decision.frontiers), default=0.0)
        near = [f.visible_area for f in decision.frontiers if f.path_length <= limit]
        return near.index(max(near)) if near else STOP


if __name__ == "__main__":
    config = BenchmarkConfig(plans=["apartment:1-2"], agents=["nearest", "tour", LargestNearby], starts=1)
    outcome = run_benchmark(config, Path("own-agent-results"), jobs=2)
    for found in compare(outcome.rows, baseline="nearest"):
        if found.metric == "d95":
            print(f"{found.agent}: {found.ratio.estimate:.2f} of the metres of nearest to 95 %")
