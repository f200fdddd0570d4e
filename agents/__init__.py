"""Exploration strategies: heuristics here, learned policies in `layoutexplore.agents.rl`.

Importing a module registers its agents; `make_agent` builds one from its name and parameters.
"""

from __future__ import annotations

from layoutexplore.agents import (
    greedy,
    mapex,
    plan_tour,
    policy,
    published,
    room_aware,
    tour,
    waiting,
    watchful_tour,
)
from layoutexplore.agents.base import AGENTS, agent_names, describe_agents, make_agent, register_agent
from layoutexplore.agents.omniscient import agent as clairvoyant

__all__ = [
    "AGENTS",
    "agent_names",
    "clairvoyant",
    "describe_agents",
    "greedy",
    "make_agent",
    "mapex",
    "plan_tour",
    "policy",
    "published",
    "register_agent",
    "room_aware",
    "tour",
    "waiting",
    "watchful_tour",
]
