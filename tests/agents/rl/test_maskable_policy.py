"""The policy class of stable-baselines3: masks hold, and the actor may wait."""

from __future__ import annotations

import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("sb3_contrib")

from gymnasium import spaces  # noqa: E402

from layoutexplore.agents.rl.maskable_policy import FrontierPolicy  # noqa: E402
from layoutexplore.envs.observation import ObservationConfig  # noqa: E402
from tests.agents.rl.cases import SLOTS, observations, spec  # noqa: E402


def test_the_policy_respects_the_mask() -> None:
    config = ObservationConfig(max_frontiers=SLOTS, local_map=False, global_map=False)
    policy = FrontierPolicy(config.space, spaces.Discrete(SLOTS + 1), lambda _: 1e-3, spec=spec())
    observation = observations([2, 5, 9])
    masks = observation["action_mask"].numpy().astype(bool)
    masks[:, -1] = False
    for _ in range(50):
        with torch.no_grad():
            actions, values, log_prob = policy(observation, action_masks=masks)
        assert masks[np.arange(3), actions.numpy()].all()
    _, again, _ = policy.evaluate_actions(observation, actions, action_masks=masks)
    torch.testing.assert_close(again, log_prob)
    assert values.shape == (3, 1)


def test_while_the_actor_waits_only_the_critic_gets_gradients() -> None:
    config = ObservationConfig(max_frontiers=SLOTS, local_map=False, global_map=False)
    policy = FrontierPolicy(config.space, spaces.Discrete(SLOTS + 1), lambda _: 1e-3, spec=spec())
    policy.actor_waits = True
    values, log_prob, entropy = policy.evaluate_actions(observations([2, 5]), torch.tensor([0, 1]))
    (values.sum() + log_prob.sum() + entropy.sum()).backward()
    assert all(p.grad is None for p in policy.actor.parameters())
    assert any(p.grad is not None for p in policy.critic.parameters())
