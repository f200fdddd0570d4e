"""Some decisions of a batch."""

from __future__ import annotations

import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("sb3_contrib")


from layoutexplore.agents.rl.networks.frontier_batch import Reader  # noqa: E402
from tests.agents.rl.cases import SLOTS, observations, spec  # noqa: E402

COUNTS = [3, 0, SLOTS, 5, 1, 7]


def test_some_decisions_of_many() -> None:
    batch = Reader(spec())(observations(COUNTS))
    chosen = torch.tensor([4, 2, 1, 0])
    taken = batch.take(chosen)
    alone = Reader(spec())({name: array[chosen] for name, array in observations(COUNTS).items()})
    for mine, theirs in zip(taken, alone, strict=True):
        if isinstance(mine, torch.Tensor):
            torch.testing.assert_close(mine, theirs, rtol=0, atol=0)
        else:
            assert mine == theirs
