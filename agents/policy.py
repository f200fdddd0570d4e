"""Trained policies as agents; the networks are imported when one is made (`pip install 'layoutexplore[rl]'`)."""

from __future__ import annotations

from dataclasses import dataclass

from layoutexplore.agents.base import register
from layoutexplore.errors import require
from layoutexplore.frontiers.decision import Agent
from layoutexplore.options import Options, option


@dataclass(frozen=True, kw_only=True)
class PolicyOptions(Options):
    """Parameters of a trained policy."""

    path: str = option(
        "layout", "a policy's file, a folder of `layoutexplore train`, or a shipped policy", positional=True
    )


def _load(name: str, options: PolicyOptions) -> Agent:
    """The agent of a policy.

    Raises:
        MissingExtraError: torch is not installed.
    """
    require("torch", "rl")
    from layoutexplore.agents.rl.agent import load_agent

    return load_agent(name, options.path)


register("policy", "a trained policy: policy:FILE, or a shipped one", _load, PolicyOptions())
