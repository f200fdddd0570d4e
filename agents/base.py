"""The registry of agents: by name, by `NAME:key=value,...`, and with their parameters described.

An agent is registered with a frozen dataclass of its parameters (a child of `Options`), whose fields say what
they mean and which values make sense. A preset is a further name for the same agent with other defaults.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Generic, TypeVar

from layoutexplore.errors import ConfigError, checks_calls
from layoutexplore.frontiers.decision import STOP, Agent, Choice, Decision
from layoutexplore.options import SEED, Options, check_kind
from layoutexplore.plugins.registry import Description, Registry
from layoutexplore.plugins.signatures import check_takes

OptionsT = TypeVar("OptionsT", bound=Options)


@checks_calls
class Heuristic(Generic[OptionsT]):
    """An agent that needs no memory: it stops where no frontier is left, and else scores what it is given.

    Args:
        name: What it is called in results.
        options: Its parameters.
    """

    remembers = False
    """Whether a choice depends on more than the decision; a saved run asks agents that do from the start."""

    def __init_subclass__(cls, **options: Any) -> None:
        """What a child that ships decides with says by name what is no decision, when it is asked by hand."""
        super().__init_subclass__(**options)
        if cls.__module__.startswith("layoutexplore."):  # in a user's own, errors stay as they are
            checks_calls(cls)

    def __init__(self, name: str, options: OptionsT) -> None:
        check_kind("options", options, Options)
        self.name = name
        self.options = options

    def reset(self, seed: int) -> None:
        """Begin a new run; a heuristic without randomness has nothing to forget."""
        SEED.convert("seed", seed)

    def act(self, decision: Decision) -> Choice:
        """The frontier to go to, or `STOP` when there is none."""
        check_kind("decision", decision, Decision)
        return self.choose(decision) if decision.frontiers else STOP

    def choose(self, decision: Decision) -> Choice:
        """The choice at a decision that has at least one frontier."""
        raise NotImplementedError

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.name}>"


def settle_predictor(options: Any) -> None:
    """Write the predictor among an agent's options as `predictor_inside` does; the default stays as it is.

    Args:
        options: Have a `predictor`; called as they are made.
    """
    if "=" in options.predictor and options.predictor != type(options).predictor:
        from layoutexplore.predictors import predictor_inside  # loads all of them, and few agents name one

        object.__setattr__(options, "predictor", predictor_inside(options.predictor))


def _accept(name: str, made: Any) -> Agent:
    """A user's own agent, with a name where it has none.

    Raises:
        ConfigError: It cannot be reset or asked.
    """
    for method, argument in (("reset", "seed"), ("act", "decision")):
        asked = getattr(made, method, None)
        if not callable(asked):
            raise ConfigError(f"agent {name!r} is a {type(made).__name__}, which has no {method}({argument})")
        check_takes(asked, argument, f"agent {name!r}: its {method}")
    if not isinstance(getattr(made, "name", None), str):
        try:
            object.__setattr__(made, "name", name)  # a frozen dataclass takes it, too
        except AttributeError as error:
            raise ConfigError(f"agent {name!r} needs an attribute name, a text: none can be set") from error
    agent: Agent = made
    return agent


AGENTS: Registry[Agent] = Registry("agent", "layoutexplore.agents", _accept, module="layoutexplore.agents")
"""Every agent and preset by name."""


def register(name: str, summary: str, build: Callable[[str, OptionsT], Agent], defaults: OptionsT) -> None:
    """Make an agent that ships known by name; arguments and errors as `register_agent`."""
    AGENTS.ship(name, summary, build, defaults)


def register_agent(name: str, doc: str, build: Callable[..., Any], options: Any = None) -> None:
    """Make an agent of your own known by name.

    Args:
        name: Lower-case words joined by "-".
        doc: What it does, in one line.
        build: Called with the full name and the options; may import what is heavy. Without options, a class
            or function whose own parameters, all with defaults, are the options.
        options: The options it has unless told otherwise: a child of `layoutexplore.options.Options`.

    Raises:
        ConfigError: The name is taken by something else.
    """
    AGENTS.register(name, doc, build, options)


def make_agent(spec: str) -> Agent:
    """An agent from `NAME`, `NAME:key=value,key=value`, `FILE.py:CLASS` or `package.module:CLASS`.

    The `name` of one that ships is the spec in a canonical form: parameters in a fixed order, those that have
    their default left out.

    Raises:
        UnknownNameError: No agent has that name, or it has no such parameter; the closest ones are suggested.
        ConfigError: The spec is not of that form, or a value makes no sense.
        OwnCodeError: A user's own agent cannot be loaded.

    Example:
        >>> from layoutexplore.agents import make_agent
        >>> make_agent("nearest:min_size=0.40").name
        'nearest:min_size=0.4'
        >>> make_agent("nearest:min_size=1").name
        'nearest'
    """
    return AGENTS.make(spec)


def agent_names() -> list[str]:
    """The names of all agents and presets, sorted."""
    return sorted(AGENTS.names())


def describe_agents() -> list[Description]:
    """All agents in the order of their registration, with their parameters, for help pages and tables."""
    return AGENTS.describe()
