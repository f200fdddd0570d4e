"""Acting in groups that do not wait for each other, and what a rollout teaches."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("sb3_contrib")

from gymnasium import spaces  # noqa: E402

from layoutexplore.agents.rl.environments import make_envs  # noqa: E402
from layoutexplore.agents.rl.networks.actor_critic import Actor  # noqa: E402
from layoutexplore.agents.rl.networks.frontier_batch import Reader  # noqa: E402
from layoutexplore.agents.rl.networks.pooling import pool, spread  # noqa: E402
from layoutexplore.agents.rl.policy import FrontierPolicy  # noqa: E402
from layoutexplore.agents.rl.ppo.collector import Collector  # noqa: E402
from layoutexplore.agents.rl.ppo.rollout import Rollout, TrainingBatch  # noqa: E402
from layoutexplore.agents.rl.ppo.update import Update  # noqa: E402
from layoutexplore.agents.rl.vector import VectorAdapter  # noqa: E402
from layoutexplore.envs.observation import ObservationConfig  # noqa: E402
from tests.agents.rl.cases import SLOTS, observations, random_actor, small_config, spec  # noqa: E402

COUNTS = [3, 0, SLOTS, 5, 1, 7]


def filled(env: VectorAdapter, steps: int = 6) -> tuple[Rollout, Any]:
    """A rollout of an actor in environments, and the episodes that ended in it."""
    torch.manual_seed(5)
    actor = Actor(spec())
    rollout = Rollout(steps, env.observation_space, env.action_space, "cpu", n_envs=env.num_envs)
    env.seed(3)
    seen, starts = env.reset(), np.ones(env.num_envs, np.bool_)
    torch.manual_seed(6)
    return rollout, Collector(actor, env, rollout, seen, starts, lambda count: count > 0).run()


def test_it_does_not_matter_which_group_is_quicker(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Groups on threads, each held up in turn, against all environments one after the other."""
    config = small_config(tmp_path, envs=3)
    found = []
    for slow in (None, 0, 1):
        env = make_envs(config)
        if slow is not None:
            import gymnasium

            from layoutexplore.agents.rl.environments import environment_arguments

            env.close()
            env = VectorAdapter(
                gymnasium.make_vec(
                    config.environment, 3, workers=2, backend="threads", **environment_arguments(config)
                )
            )
            member = env._native._workers.members[slow]  # type: ignore[attr-defined]
            step = member.step
            monkeypatch.setattr(member, "step", lambda step=step: (time.sleep(0.02), step()))
        found.append(filled(env))
        env.close()
    (first, ends), others = found[0], found[1:]
    assert ends is not None
    for other, told in others:
        assert told is not None and told.keys() == ends.keys()
        for name in ("actions", "rewards", "episode_starts", "action_masks"):
            np.testing.assert_array_equal(getattr(first, name), getattr(other, name))
        np.testing.assert_allclose(first.log_probs, other.log_probs, atol=1e-5)
        for name, array in first.observations.items():
            np.testing.assert_array_equal(array, other.observations[name])


def test_a_collector_stops_when_told_and_leaves_nothing_unanswered(tmp_path: Path) -> None:
    env = make_envs(small_config(tmp_path))
    env.seed(0)
    seen, starts = env.reset(), np.ones(2, np.bool_)
    rollout = Rollout(8, env.observation_space, env.action_space, "cpu", n_envs=2)
    counted: list[int] = []

    def told(decisions: int) -> bool:
        counted.append(decisions)
        return len(counted) < 3

    assert Collector(Actor(spec()), env, rollout, seen, starts, told).run() is None
    assert counted == [2, 2, 2]
    env.step(np.zeros(2, np.int64))
    env.close()


def test_some_situations_of_many() -> None:
    batch = Reader(spec())(observations(COUNTS))
    chosen = torch.tensor([4, 2, 1, 0])
    taken = batch.take(chosen)
    alone = Reader(spec())({name: array[chosen] for name, array in observations(COUNTS).items()})
    for mine, theirs in zip(taken, alone, strict=True):
        if isinstance(mine, torch.Tensor):
            torch.testing.assert_close(mine, theirs, rtol=0, atol=0)
        else:
            assert mine == theirs


@pytest.mark.parametrize("encoder", ["pooled", "attention", "deep-sets", "none"])
def test_a_decision_is_judged_alike_alone_and_among_others(encoder: str) -> None:
    actor, many = random_actor(encoder), observations(COUNTS)
    with torch.no_grad():
        together = actor(many)
        for k in range(len(COUNTS)):
            alone = actor({name: array[k : k + 1] for name, array in many.items()})
            torch.testing.assert_close(alone[0], together[k], rtol=1e-4, atol=1e-5)


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
    """With the ratio at 1, advantages are weighed by how much likelier the actions have become."""
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
