"""Actor and critic: what may not matter does not matter."""

from __future__ import annotations

import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("sb3_contrib")


from layoutexplore.agents.rl.networks.actor_critic import Actor, Critic  # noqa: E402
from layoutexplore.envs.observation import FRONTIER_FEATURES  # noqa: E402
from tests.agents.rl.cases import SLOTS, observations, random_actor, spec  # noqa: E402

encoders = pytest.mark.parametrize("encoder", ["pooled", "attention", "deep-sets"])


all_encoders = pytest.mark.parametrize("encoder", ["pooled", "attention", "deep-sets", "none"])


COUNTS = [1, 3, SLOTS, 7]


def shuffled(observation: dict, order: np.ndarray) -> dict:
    table = observation["frontiers"].reshape(len(COUNTS), SLOTS, -1)[:, order]
    return {**observation, "frontiers": table.reshape(len(COUNTS), -1)}


@all_encoders
@pytest.mark.parametrize("maps", [False, True])
def test_a_permutation_of_the_frontiers_permutes_the_logits(encoder: str, maps: bool) -> None:
    actor, observation = random_actor(encoder, maps=maps), observations(COUNTS, maps=maps)
    order = np.random.default_rng(1).permutation(SLOTS)
    with torch.no_grad():
        straight, permuted = actor(observation), actor(shuffled(observation, order))
    present = torch.arange(SLOTS)[None] < torch.tensor(COUNTS)[:, None]
    torch.testing.assert_close(
        permuted[:, :-1][present[:, order]], straight[:, order][present[:, order]], rtol=1e-4, atol=1e-5
    )
    torch.testing.assert_close(permuted[:, -1], straight[:, -1], rtol=1e-4, atol=1e-5)


@all_encoders
def test_the_number_of_slots_does_not_matter(encoder: str) -> None:
    actor, observation = random_actor(encoder), observations([3, 5])
    table = observation["frontiers"].reshape(2, SLOTS, -1)
    with torch.no_grad():
        wide = actor(observation)
        narrow = actor({**observation, "frontiers": table[:, :5].reshape(2, -1)})
    torch.testing.assert_close(narrow[:, :3], wide[:, :3], rtol=1e-4, atol=1e-5)
    torch.testing.assert_close(narrow[:, -1], wide[:, -1], rtol=1e-4, atol=1e-5)


@encoders
def test_other_frontiers_matter(encoder: str) -> None:
    actor, observation = random_actor(encoder), observations([4])
    moved = observation["frontiers"].clone()
    moved[0, 3 * len(FRONTIER_FEATURES) + 1] += 5.0
    with torch.no_grad():
        assert (actor(observation)[0, 0] - actor({**observation, "frontiers": moved})[0, 0]).abs() > 1e-4


@all_encoders
def test_an_untrained_actor_prefers_the_tours_first(encoder: str) -> None:
    observation = observations([6, 9])
    table = observation["frontiers"].reshape(2, SLOTS, -1)
    rank = list(FRONTIER_FEATURES).index("tour_rank")
    table[..., rank] = 0.0
    table[..., list(FRONTIER_FEATURES).index("detour")] = 0.0
    table[0, 4, rank] = table[1, 7, rank] = 1.0
    with torch.no_grad():
        logits = Actor(spec(encoder))({**observation, "frontiers": table.reshape(2, -1)})
    assert logits[:, :-1].argmax(dim=1).tolist() == [4, 7]


def test_no_frontier_at_all() -> None:
    observation = observations([0, 0])
    with torch.no_grad():
        logits, values = random_actor()(observation), Critic(spec(), 0)(observation)
    assert logits.shape == (2, SLOTS + 1) and bool(
        torch.isfinite(logits).all() and torch.isfinite(values).all()
    )


def test_only_the_critic_sees_what_is_privileged() -> None:
    actor, critic, observation = random_actor(), Critic(spec(), 3), observations([4, 4])
    hidden = {**observation, "privileged": torch.zeros(2, 3)}
    shown = {**observation, "privileged": torch.ones(2, 3)}
    with torch.no_grad():
        assert torch.equal(actor(hidden), actor(shown))
        assert not torch.equal(critic(hidden), critic(shown))


def test_it_is_small() -> None:
    assert sum(p.numel() * 4 for p in Actor(spec()).parameters()) < 1_000_000
