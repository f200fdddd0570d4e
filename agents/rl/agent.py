"""A trained network as an agent: it reads the `Decision` of a heuristic, as the environment encodes it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import torch
from numpy.typing import NDArray

from layoutexplore.agents.rl.card import PolicySpec
from layoutexplore.agents.rl.linear import PolicyAgent
from layoutexplore.agents.rl.networks.actor_critic import Actor
from layoutexplore.envs.observation import Observer
from layoutexplore.errors import checks_making
from layoutexplore.frontiers.decision import Decision
from layoutexplore.grids.arrays import Floats32


@checks_making
class NetworkPolicy(PolicyAgent):
    """Goes to the frontier with the highest logit of a network; it stops only when none is left.

    Args:
        name: What it is called in results.
        actor: The network.
        spec: What it reads.
        fingerprint: Of its file, if there is one.
    """

    def __init__(self, name: str, actor: Actor, spec: PolicySpec, fingerprint: str = "") -> None:
        super().__init__(name, spec, fingerprint)
        self.actor = actor
        self.reset(0)

    def reset(self, seed: int) -> None:
        """Begin a new run, with an observer that has seen nothing of it."""
        super().reset(seed)
        self._observer = Observer(self.observed(1))

    def logits(self, decision: Decision) -> Floats32:
        """float32 (n,): a logit for each of the decision's frontiers."""
        count = len(decision.frontiers)
        self._observer.config = self.observed(count)
        return logits_of(self.actor, self._observer.observe(decision))[:count]


def logits_of(actor: Actor, observation: Mapping[str, NDArray[np.generic]]) -> Floats32:
    """float32 (slots + 1,): the logits of an actor for one observation."""
    batch = {name: torch.from_numpy(np.asarray(array)[None]) for name, array in observation.items()}
    with torch.no_grad():
        logits: Floats32 = actor(batch)[0].numpy()
    return logits
