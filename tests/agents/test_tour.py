"""The agent that plans a tour."""

from __future__ import annotations

from tests.agents.cases import CORRIDOR, chosen, decide


def test_a_tour_takes_the_short_end_first() -> None:
    """To the left is one frontier, to the right are two: nearest goes right, the tour left."""
    decision = decide(CORRIDOR, (1, 4, 2.0, 1.0), (1, 9, 2.0, 1.0), (1, 17, 2.0, 1.0))
    assert chosen("nearest", decision) == (1, 9)
    assert chosen("tour", decision) == (1, 4)
