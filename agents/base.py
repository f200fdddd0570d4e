"""The registry of agents: by name, by `NAME:key=value,...`, and with their parameters described.

An agent is registered with a frozen dataclass of its parameters (a child of `Options`), whose fields say what
they mean and which values make sense. A preset is a further name for the same agent with other defaults.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, NamedTuple, TypeVar

from layoutexplore.errors import ConfigError
from layoutexplore.frontiers.decision import STOP, Agent, Choice, Decision
from layoutexplore.options import Options, format_spec, format_value, parse_spec

OptionsT = TypeVar("OptionsT", bound=Options)


class Heuristic(Generic[OptionsT]):
    """An agent that needs no memory: it stops where no frontier is left, and else scores what it is given.

    Args:
        name: What it is called in results.
        options: Its parameters.
    """

    def __init__(self, name: str, options: OptionsT) -> None:
        self.name = name
        self.options = options

    def reset(self, seed: int) -> None:
        """Begin a new run; a heuristic without randomness has nothing to forget."""

    def act(self, decision: Decision) -> Choice:
        """The frontier to go to, or `STOP` when there is none."""
        return self.choose(decision) if decision.frontiers else STOP

    def choose(self, decision: Decision) -> Choice:
        """The choice at a decision that has at least one frontier."""
        raise NotImplementedError

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.name}>"


class AgentDescription(NamedTuple):
    """A row of the table of agents: name, what it does, and its parameters as (key, default, meaning)."""

    name: str
    summary: str
    parameters: tuple[tuple[str, str, str], ...]


@dataclass(frozen=True)
class _Entry:
    summary: str
    build: Callable[[str, Any], Agent]
    defaults: Options


_entries: dict[str, _Entry] = {}


def register(name: str, summary: str, build: Callable[[str, OptionsT], Agent], defaults: OptionsT) -> None:
    """Make an agent known by name.

    Args:
        name: Lower-case words joined by "-".
        summary: What it does, in one line.
        build: Called with the full name and the options; may import what is heavy.
        defaults: The options it has unless told otherwise.

    Raises:
        ConfigError: The name is taken by something else. (The same thing again changes nothing: a module may
            be imported under two names, as test collectors do.)
    """
    if name in _entries:
        if (_entries[name].build.__qualname__, str(_entries[name].defaults)) != (
            build.__qualname__,
            str(defaults),
        ):
            raise ConfigError(f"there is an agent {name!r} already")
        return
    _entries[name] = _Entry(summary, build, defaults)


def make_agent(spec: str) -> Agent:
    """An agent from `NAME` or `NAME:key=value,key=value`.

    Its `name` is the spec in a canonical form: parameters in a fixed order, those that have their default
    left out.

    Raises:
        UnknownNameError: No agent has that name, or it has no such parameter; the closest ones are suggested.
        ConfigError: The spec is not of that form, or a value makes no sense.

    Example:
        >>> from layoutexplore.agents import make_agent
        >>> make_agent("nearest:min_size=0.40").name
        'nearest:min_size=0.4'
        >>> make_agent("nearest:min_size=1").name
        'nearest'
    """
    name, options = parse_spec("agent", spec, {name: entry.defaults for name, entry in _entries.items()})
    entry = _entries[name]
    return entry.build(format_spec(name, options, entry.defaults), options)


def agent_names() -> list[str]:
    """The names of all agents and presets, sorted."""
    return sorted(_entries)


def describe_agents() -> list[AgentDescription]:
    """All agents in the order of their registration, with their parameters, for help pages and tables."""
    return [
        AgentDescription(name, entry.summary, _parameters(entry.defaults)) for name, entry in _entries.items()
    ]


def _parameters(defaults: Options) -> tuple[tuple[str, str, str], ...]:
    fields = dataclasses.fields(defaults)
    return tuple((f.name, format_value(getattr(defaults, f.name)), f.metadata["text"]) for f in fields)
