"""A trained policy as an agent: it reads the same `Decision` as the heuristics, through the encoder of the environment."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import torch
from numpy.typing import NDArray

from layoutexplore.agents.rl.card import PolicySpec, find_policy
from layoutexplore.agents.rl.network import Actor
from layoutexplore.agents.rl.policy_file import load_actor
from layoutexplore.envs.observation import ObservationConfig, Observer
from layoutexplore.files import fingerprint
from layoutexplore.frontiers.decision import STOP, Choice, Decision


class PolicyAgent:
    """Goes to the frontier with the highest logit; it stops only when none is left.

    Args:
        name: What it is called in results.
        actor: The network.
        spec: What it reads.
        fingerprint: Of its file, if there is one.
    """

    def __init__(self, name: str, actor: Actor, spec: PolicySpec, fingerprint: str = "") -> None:
        self.name = name
        self.actor = actor
        self.spec = spec
        self.fingerprint = fingerprint
        self.reset(0)

    @property
    def predictor(self) -> str:
        """The predictor that the policy was trained with."""
        return self.spec.predictor

    def reset(self, seed: int) -> None:
        """Begin a new run."""
        self._observer = Observer(self._shown(1))

    def act(self, decision: Decision) -> Choice:
        """The frontier to go to, or `STOP` when there is none."""
        if not decision.frontiers:
            return STOP
        return int(np.argmax(self.logits(decision)))

    def logits(self, decision: Decision) -> NDArray[np.float32]:
        """float32 (n,): a logit for each of the decision's frontiers."""
        count = len(decision.frontiers)
        self._observer.config = self._shown(count)
        observation = self._observer.observe(decision)
        with torch.no_grad():
            scores: NDArray[np.float32] = self.actor(as_batch(observation))[0, :count].numpy()
        return scores

    def _shown(self, slots: int) -> ObservationConfig:
        """What has to be observed; the policy does not care how many slots there are, so none is left out."""
        maps = bool(self.spec.map_channels)
        return ObservationConfig(
            max_frontiers=slots,
            local_map=False,
            global_map=maps,
            detour=self.spec.reads_tour,
            tour=self.spec.tour,
        )

    def __repr__(self) -> str:
        return f"<PolicyAgent {self.name}>"


def load_agent(name: str, policy: str) -> PolicyAgent:
    """The agent of a policy: a file, a training folder, or a name that ships.

    Raises:
        ConfigError: There is no such policy.
        ResultsError: Its file is damaged, or cannot be run by this version.
    """
    path = find_policy(policy)
    return PolicyAgent(name, *load_actor(path), fingerprint([path]))


def as_batch(observation: Mapping[str, NDArray[np.generic]]) -> dict[str, torch.Tensor]:
    """An observation as a batch of one."""
    return {name: torch.from_numpy(np.asarray(array)[None]) for name, array in observation.items()}
