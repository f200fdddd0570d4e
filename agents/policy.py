"""Trained policies as agents: `policy` ships, `policy:FILE` is one of your own.

A policy without encoder or with the encoder "pooled", as those that ship, runs on NumPy alone; the network of
any other is torch's (`pip install 'layoutexplore[rl]'`) and is imported when such an agent is made.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from layoutexplore.agents.base import register
from layoutexplore.agents.rl.card import find_policy, read_spec
from layoutexplore.agents.rl.linear import LinearPolicy, PolicyAgent, linear_shapes
from layoutexplore.agents.rl.pooled import PooledPolicy, pooled_shapes
from layoutexplore.errors import checks_arguments, require
from layoutexplore.files import fingerprint
from layoutexplore.files.tensors import read_tensors
from layoutexplore.frontiers.decision import Agent
from layoutexplore.grids.arrays import Floats32
from layoutexplore.options import Options, option


@checks_arguments
def load_policy(name: str, policy: str) -> PolicyAgent:
    """The agent of a policy: a file, a training folder, or a name that ships.

    Raises:
        ConfigError: There is no such policy.
        ResultsError: Its file is damaged, or cannot be run by this version.
        MissingExtraError: Its network needs torch, which is not installed.
    """
    path = find_policy(policy)
    spec = read_spec(path)
    if spec.network.encoder == "none":
        return LinearPolicy(name, _weights(path, linear_shapes(spec)), spec, fingerprint([path]))
    if spec.network.encoder == "pooled" and not spec.map_channels:
        return PooledPolicy(name, _weights(path, pooled_shapes(spec)), spec, fingerprint([path]))
    require("torch", "rl")
    from layoutexplore.agents.rl.agent import NetworkPolicy
    from layoutexplore.agents.rl.torch_policy_files import load_actor

    return NetworkPolicy(name, load_actor(path)[0], spec, fingerprint([path]))


def _weights(path: Path, shapes: dict[str, tuple[int, ...]]) -> Mapping[str, Floats32]:
    weights, _ = read_tensors(path, shapes, what="policy")
    return {name: np.asarray(weights[name], np.float32) for name in shapes}


@dataclass(frozen=True, kw_only=True)
class PolicyOptions(Options):
    """Parameters of a trained policy."""

    path: str = option(
        "layout", "a policy's file, a folder of `layoutexplore train`, or a shipped policy", positional=True
    )


def _load(name: str, options: PolicyOptions) -> Agent:
    return load_policy(name, options.path)


register("policy", "a trained policy: policy:FILE, or a shipped one", _load, PolicyOptions())
