"""The registry of agents: by name, by `NAME:key=value,...`, and with their parameters described.

An agent is registered with a frozen dataclass of its parameters (a child of `Options`), whose fields say what
they mean and which values make sense. A preset is a further name for the same agent with other defaults.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, NamedTuple, TypeVar

from layoutexplore.errors import ConfigError, unknown_name
from layoutexplore.frontiers.decision import STOP, Agent, Choice, Decision

Value = bool | int | float | str


def option(
    default: Value,
    text: str,
    *,
    low: float = -math.inf,
    high: float = math.inf,
    choices: tuple[str, ...] = (),
    positional: bool = False,
) -> Any:
    """A field of an `Options` class.

    Args:
        default: Its default; it also decides the type that is read from a text.
        text: What it means, with its unit.
        low: Least number that makes sense.
        high: Greatest number that makes sense.
        choices: The words that are allowed; for a text.
        positional: Whether the value may stand right behind the colon without the key, `NAME:VALUE`; for one
            text.
    """
    metadata = {"text": text, "low": low, "high": high, "choices": choices, "positional": positional}
    return dataclasses.field(default=default, metadata=metadata)


@dataclass(frozen=True, kw_only=True)
class Options:
    """Parameters of an agent; subclasses add fields made by `option`.

    Raises:
        ConfigError: A value has the wrong type or lies outside what makes sense.
    """

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            _check_value(field, getattr(self, field.name))


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
    name, colon, text = spec.strip().partition(":")
    if name not in _entries:
        raise unknown_name("agent", name, _entries)
    entry = _entries[name]
    if colon and not text.strip():
        raise ConfigError(
            f"agent {spec!r}: nothing follows the colon; write {name!r} or NAME:key=value,key=value"
        )
    options = _parsed(spec, entry.defaults, text) if colon else entry.defaults
    return entry.build(_canonical(name, options, entry.defaults), options)


def agent_names() -> list[str]:
    """The names of all agents and presets, sorted."""
    return sorted(_entries)


def describe_agents() -> list[AgentDescription]:
    """All agents in the order of their registration, with their parameters and defaults, for help pages and tables."""
    return [
        AgentDescription(name, entry.summary, _parameters(entry.defaults)) for name, entry in _entries.items()
    ]


def _parameters(defaults: Options) -> tuple[tuple[str, str, str], ...]:
    fields = dataclasses.fields(defaults)
    return tuple((f.name, _format(getattr(defaults, f.name)), f.metadata["text"]) for f in fields)


def _parsed(spec: str, defaults: Options, text: str) -> Options:
    """The defaults with the parameters of a text like "a=1,b=2" put in."""
    fields = {field.name: field for field in dataclasses.fields(defaults)}
    first = next((name for name, field in fields.items() if field.metadata["positional"]), "")
    values: dict[str, Value] = {}
    for number, item in enumerate(text.split(",")):
        key, equals, value = (part.strip() for part in item.partition("="))
        if first and number == 0 and key not in fields:
            key, equals, value = first, "=", item.strip()
        if not (equals and key and value):
            raise ConfigError(f"agent {spec!r}: {item.strip()!r} is not of the form key=value")
        if key not in fields:
            if not fields:
                raise ConfigError(f"agent {spec!r}: it has no parameters")
            raise unknown_name(f"parameter of agent {spec.partition(':')[0]!r}", key, fields)
        if key in values:
            raise ConfigError(f"agent {spec!r}: {key!r} is given twice")
        values[key] = _read(spec, key, type(getattr(defaults, key)), value)
    try:
        return dataclasses.replace(defaults, **values)
    except ConfigError as error:
        raise ConfigError(f"agent {spec!r}: {error}") from None


def _read(spec: str, key: str, kind: type[Value], text: str) -> Value:
    """The value of a text in the type that the parameter's default has."""
    try:
        if kind is bool:
            return {"true": True, "false": False}[text.lower()]
        return kind(text)
    except (ValueError, KeyError):
        wanted = {bool: "true or false", int: "a whole number", float: "a number"}[kind]
        raise ConfigError(f"agent {spec!r}: {key} must be {wanted}, got {text!r}") from None


def _check_value(field: dataclasses.Field[Any], value: Value) -> None:
    low, high, choices = (field.metadata[key] for key in ("low", "high", "choices"))
    if isinstance(field.default, str):
        if choices and value not in choices:
            raise unknown_name(field.name, str(value), choices)
    elif not isinstance(value, (int, float)) or not math.isfinite(value) or not low <= value <= high:
        bounds = f"from {low:g} to {high:g}" if math.isfinite(high) else f"of {low:g} or more"
        raise ConfigError(f"{field.name} must be a number {bounds}, got {value!r}")


def _format(value: Value) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return repr(value).removesuffix(".0") if isinstance(value, float) else str(value)


def _canonical(name: str, options: Options, defaults: Options) -> str:
    changed = [
        ("" if field.metadata["positional"] else f"{field.name}=") + _format(getattr(options, field.name))
        for field in dataclasses.fields(options)
        if getattr(options, field.name) != getattr(defaults, field.name)
    ]
    return f"{name}:{','.join(changed)}" if changed else name
