"""Encoders: a decision is judged alike, alone and among others."""

from __future__ import annotations

import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("sb3_contrib")


from tests.agents.rl.cases import SLOTS, observations, random_actor  # noqa: E402

COUNTS = [3, 0, SLOTS, 5, 1, 7]


@pytest.mark.parametrize("encoder", ["pooled", "attention", "deep-sets", "none"])
def test_a_decision_is_judged_alike_alone_and_among_others(encoder: str) -> None:
    actor, many = random_actor(encoder), observations(COUNTS)
    with torch.no_grad():
        together = actor(many)
        for k in range(len(COUNTS)):
            alone = actor({name: array[k : k + 1] for name, array in many.items()})
            torch.testing.assert_close(alone[0], together[k], rtol=1e-4, atol=1e-5)
