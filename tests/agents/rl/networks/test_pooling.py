"""Sums over the frontiers of each decision, against torch."""

from __future__ import annotations

import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("sb3_contrib")


from layoutexplore.agents.rl.networks.pooling import pool, spread  # noqa: E402


@pytest.mark.parametrize("counts", [[3, 0, 5, 1], [0, 2], [70, 2]])
def test_pools_and_their_gradients_are_those_of_torch(counts: list[int]) -> None:
    generator = torch.Generator().manual_seed(0)
    each, width = torch.tensor(counts), 6
    tokens = torch.rand(sum(counts), width, generator=generator).requires_grad_()
    weights = torch.rand(len(counts), 2 * width, generator=generator)
    (pool(tokens, each) * weights).sum().backward()
    found, tokens.grad = tokens.grad, None
    rows = tokens.split(counts)
    means = torch.stack([part.mean(dim=0) if len(part) else torch.zeros(width) for part in rows])
    greatest = torch.stack([part.amax(dim=0) if len(part) else torch.zeros(width) for part in rows])
    expected = torch.cat([means, greatest], dim=1)
    torch.testing.assert_close(pool(tokens, each), expected)
    (expected * weights).sum().backward()
    torch.testing.assert_close(found, tokens.grad)


def test_spreading_and_its_gradient_are_those_of_torch() -> None:
    counts = torch.tensor([2, 0, 3])
    owners, shared = torch.repeat_interleave(torch.arange(3), counts), torch.rand(3, 4).requires_grad_()
    weights = torch.rand(5, 4)
    rows = spread(shared, owners, counts)
    torch.testing.assert_close(rows, shared[owners])
    (rows * weights).sum().backward()
    found, shared.grad = shared.grad, None
    (shared[owners] * weights).sum().backward()
    torch.testing.assert_close(found, shared.grad)
