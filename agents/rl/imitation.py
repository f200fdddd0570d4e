"""Imitation of an agent by DAgger (Ross, Gordon and Bagnell 2011), as a start for learning by reward.

In the first round the robot follows the teacher, in later ones the policy; the teacher says at every decision
what it would have done, and the policy learns from all decisions so far. So it also learns what to do where
its own mistakes lead.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import gymnasium
import numpy as np
import torch
from numpy.typing import NDArray
from torch.nn import functional

from layoutexplore.agents import make_agent
from layoutexplore.agents.rl.agent import logits_of
from layoutexplore.agents.rl.environments import environment_arguments
from layoutexplore.agents.rl.explorers import Stop
from layoutexplore.agents.rl.hyperparameters import ImitationConfig, TrainingConfig
from layoutexplore.agents.rl.networks.actor_critic import Actor
from layoutexplore.envs.frontier import FrontierEnv
from layoutexplore.envs.observation import Observer
from layoutexplore.frontiers.decision import PATHS, STOP, Agent, Decision, Privileged, path_of
from layoutexplore.frontiers.walks import plain_choice
from layoutexplore.grids.arrays import Ints

NEAR = 1.0
"""Metres from a frontier at which a teacher's way has come to it."""


@dataclass
class Demonstrations:
    """Decisions with what the teacher would have done.

    Attributes:
        observations: A list of arrays for every key.
        choices: The teacher's action at each.
    """

    observations: dict[str, list[NDArray[np.generic]]] = field(default_factory=dict)
    choices: list[int] = field(default_factory=list)

    def add(self, observation: dict[str, NDArray[np.generic]], choice: int) -> None:
        """Remember a decision."""
        for name, array in observation.items():
            self.observations.setdefault(name, []).append(array)
        self.choices.append(choice)

    def batch(self, chosen: Ints) -> tuple[dict[str, torch.Tensor], torch.Tensor]:
        """Some of the decisions as tensors."""
        stacked = {
            n: torch.from_numpy(np.stack([rows[k] for k in chosen])) for n, rows in self.observations.items()
        }
        return stacked, torch.tensor([self.choices[k] for k in chosen])


def imitate(
    actor: Actor, config: TrainingConfig, say: Callable[[str], None], stop: Stop = lambda: False
) -> None:
    """Teach an actor in place what the configuration's teacher does.

    Args:
        actor: The network.
        config: Of the run.
        say: Told how each round went.
        stop: Asked after every exploration whether to end early.
    """
    plan = config.imitation
    assert plan is not None
    teacher = make_agent(plan.teacher)
    env = gymnasium.make(config.environment, **environment_arguments(config)).unwrapped
    assert isinstance(env, FrontierEnv)
    rng = np.random.default_rng([config.seed, 1])
    optimizer = torch.optim.Adam(actor.parameters(), lr=plan.learning_rate)
    demonstrations = Demonstrations()
    for number in range(plan.rounds):
        for _ in range(-(-plan.episodes // plan.rounds)):
            attend(env, teacher, actor if number else None, demonstrations, int(rng.integers(2**31)))
            if stop():
                return
        agreement = _learn(actor, demonstrations, plan, optimizer, rng)
        found = f"{len(demonstrations.choices)} decisions, {agreement:.1%} as the teacher"
        say(f"imitation, round {number + 1} of {plan.rounds}: {found}")
    env.close()


def teachers_choice(teacher: Agent, decision: Decision) -> int:
    """The frontier that a teacher goes to, or `STOP`; where it answers with a path, the first one on it."""
    choice = plain_choice(teacher.act(decision))
    if not isinstance(choice, PATHS):
        return int(choice)
    path = path_of(choice)
    radius = NEAR / decision.grid.resolution
    gaps = np.hypot(*(path[:, None, :] - decision.viewpoints).transpose(2, 0, 1))
    arrivals = np.where(gaps <= radius, np.arange(len(path))[:, None], len(path)).min(axis=0)
    first = int(np.argmin(arrivals))
    return first if arrivals[first] < len(path) else int(np.argmin(gaps[-1]))


def attend(
    env: FrontierEnv, teacher: Agent, actor: Actor | None, demonstrations: Demonstrations, seed: int
) -> None:
    """One exploration, led by the teacher or by the policy, until it is over or the teacher would stop.

    The teacher may go to a frontier for which the environment has no slot. No policy can choose that one, so
    that such a decision is left out of what is learnt.

    Args:
        env: Draws floor plan, sensor and start.
        teacher: Who is imitated.
        actor: The policy that leads; the teacher itself where None.
        demonstrations: The decisions and the teacher's choices are added to them.
        seed: Of the exploration.
    """
    env.reset(seed=seed)
    teacher.reset(seed)
    simulation, observer = env.simulation, Observer(env.observation_config)
    if isinstance(teacher, Privileged):
        teacher.reveal(simulation.truth)
    while not simulation.done:
        decision = simulation.decision
        observation, label = observer.observe(decision), teachers_choice(teacher, decision)
        if label == STOP:
            return
        if label in range(min(observer.config.max_frontiers, len(decision.frontiers))):
            demonstrations.add(observation, label)
        env.go(label if actor is None else act(actor, observation))


def act(actor: Actor, observation: dict[str, NDArray[np.generic]]) -> int:
    """The allowed frontier with the highest logit."""
    allowed = observation["action_mask"][:-1].astype(np.bool_)
    return int(np.argmax(np.where(allowed, logits_of(actor, observation)[:-1], -np.inf)))


def _learn(
    actor: Actor,
    demonstrations: Demonstrations,
    plan: ImitationConfig,
    optimizer: torch.optim.Optimizer,
    rng: np.random.Generator,
) -> float:
    """Passes of cross-entropy over all demonstrations; the share of the last one's choices that agree."""
    agreed = 0
    for _ in range(plan.epochs):
        order, agreed = rng.permutation(len(demonstrations.choices)), 0
        for k in range(0, len(order), plan.batch_size):
            observation, choices = demonstrations.batch(order[k : k + plan.batch_size])
            logits = actor(observation)[:, :-1].masked_fill(observation["action_mask"][:, :-1] == 0, -1e8)
            loss = functional.cross_entropy(logits, choices)
            optimizer.zero_grad()
            loss.backward()  # type: ignore[no-untyped-call]
            optimizer.step()
            agreed += int((logits.argmax(dim=1) == choices).sum())
    return agreed / max(1, len(demonstrations.choices))
