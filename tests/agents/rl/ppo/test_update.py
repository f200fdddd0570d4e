"""What a rollout teaches."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("sb3_contrib")

from gymnasium import spaces  # noqa: E402

from layoutexplore.agents.rl.maskable_policy import FrontierPolicy  # noqa: E402
from layoutexplore.agents.rl.ppo.rollout import TrainingBatch  # noqa: E402
from layoutexplore.agents.rl.ppo.update import Update  # noqa: E402
from layoutexplore.envs.observation import ObservationConfig  # noqa: E402
from tests.agents.rl.cases import SLOTS, observations, spec  # noqa: E402


def batch_of(policy: FrontierPolicy) -> TrainingBatch:
    """Decisions in which the first of two frontiers turned out well, drawn from the policy as it is."""
    generator = torch.Generator().manual_seed(0)
    observation = observations([2] * 256)
    masks = observation["action_mask"].bool()
    masks[:, -1] = False
    batch = policy.actor.read(observation)
    with torch.no_grad():
        log_probs = policy.actor.log_probs(batch, masks)
    actions = torch.multinomial(log_probs.exp(), 1, generator=generator)[:, 0]
    gain = 1.0 - actions.float()
    chosen = log_probs.gather(1, actions[:, None])[:, 0]
    return TrainingBatch(batch, masks, actions, chosen, gain - gain.mean(), gain, torch.ones(256))


def fresh_policy() -> FrontierPolicy:
    torch.manual_seed(1)
    config = ObservationConfig(max_frontiers=SLOTS, local_map=False, global_map=False)
    return FrontierPolicy(config.space, spaces.Discrete(SLOTS + 1), lambda _: 1e-2, spec=spec("pooled"))


def update(**changes: Any) -> Update:
    defaults = {
        "batch_size": 64,
        "clip_range": 0.2,
        "normalize_advantage": True,
        "ent_coef": 0.0,
        "vf_coef": 0.5,
    }
    return Update(**{**defaults, "max_grad_norm": 0.5, "target_kl": None, **changes})


def test_what_went_well_becomes_more_likely() -> None:
    policy = fresh_policy()
    training_batch = batch_of(policy)
    with torch.no_grad():
        before = policy.actor.log_probs(training_batch.batch, training_batch.masks)[:, 0].exp().mean()
        error = (policy.critic.values(training_batch.batch)[:, 0] - training_batch.returns).square().mean()
    learnt = update().learn(policy, training_batch, [torch.arange(256)] * 4)
    with torch.no_grad():
        after = policy.actor.log_probs(training_batch.batch, training_batch.masks)[:, 0].exp().mean()
        left = (policy.critic.values(training_batch.batch)[:, 0] - training_batch.returns).square().mean()
    assert after > before and left < error
    assert learnt.passes == 4 and learnt.curves["approx_kl"] > 0


def test_an_update_ends_where_the_policy_has_moved_far() -> None:
    policy = fresh_policy()
    learnt = update(target_kl=1e-4).learn(policy, batch_of(policy), [torch.arange(256)] * 10)
    assert learnt.passes < 10


def test_what_an_older_actor_did_is_weighed() -> None:
    """With the ratio at 1, the gradient is that of advantages weighed by how much likelier actions are."""
    policy = fresh_policy()
    training_batch = batch_of(policy)
    older = training_batch._replace(log_probs=training_batch.log_probs - 0.3)
    twin = fresh_policy()
    settings: dict[str, Any] = {
        "batch_size": 256,
        "normalize_advantage": False,
        "max_grad_norm": 1e9,
        "vf_coef": 0.0,
    }
    update(**settings).learn(policy, older, [torch.arange(256)])
    weighed = training_batch._replace(advantages=training_batch.advantages * float(np.exp(0.3)))
    update(**settings).learn(twin, weighed, [torch.arange(256)])
    for mine, theirs in zip(policy.actor.parameters(), twin.actor.parameters(), strict=True):
        if mine.requires_grad:
            torch.testing.assert_close(mine.grad, theirs.grad, rtol=1e-4, atol=1e-6)
