"""Options of a user's own class or function: those it declares, or the parameters of its signature."""

from __future__ import annotations

import copy
import dataclasses
import functools
import inspect
import sys
from collections.abc import Callable
from typing import Any, get_args

from layoutexplore.errors import ConfigError
from layoutexplore.options import Options, option
from layoutexplore.plugins.docstrings import meanings

_READ = (bool, int, float, str)
"""Types of values that can stand in `NAME:key=value`."""


def buildable(thing: Any, what: str, *, inputs: int = 0) -> tuple[Callable[[str, Any], Any], Any]:
    """How to build a thing from a name and options, and the options it has unless told otherwise.

    Args:
        thing: A class, a function, or an object that is ready. A class with options of its own, as its
            attribute `Options` or as the parameter of a generic base (`Greedy[GreedyOptions]`), is called
            with the name and these; any other with the parameters of its signature, by name.
        what: What it is, for messages.
        inputs: How many parameters of a function are inputs: it is not called but made to wait for them.

    Raises:
        ConfigError: A parameter has no default that could be written in a text.
    """
    if not callable(thing) or not (inspect.isclass(thing) or inspect.isroutine(thing) or inputs):
        return lambda name, options: copy.deepcopy(thing), Options()
    if inspect.isclass(thing) and (declared := _declared(thing)):
        return thing, declared()
    of_function = not inspect.isclass(thing)
    options = _options_of(thing, what, inputs if of_function else 0)

    def build(name: str, chosen: Any) -> Any:
        values = {field.name: getattr(chosen, field.name) for field in dataclasses.fields(chosen)}
        return functools.partial(thing, **values) if of_function and inputs else thing(**values)

    return build, options


def signature_of(run: Callable[..., Any]) -> inspect.Signature:
    """A signature with its annotations as texts where Python 3.14 would look up what they name.

    That may be imported for type checkers alone: before, such annotations had to be texts.

    Raises:
        TypeError: It cannot be called.
        ValueError: It is compiled code that does not tell.
    """
    if sys.version_info >= (3, 14):
        from annotationlib import Format

        return inspect.signature(run, annotation_format=Format.STRING)
    return inspect.signature(run)


def check_takes(run: Callable[..., Any], argument: str, what: str) -> None:
    """Raise `ConfigError` where a function of the user's own cannot be called with this one argument."""
    try:
        signature = signature_of(run)
    except (TypeError, ValueError):
        return  # compiled code that does not tell
    try:
        signature.bind(None)
    except TypeError as error:
        raise ConfigError(f"{what} takes {signature}, but is called with ({argument})") from error


def _declared(thing: type) -> type[Options] | None:
    """The class of options that a class declares."""
    own = getattr(thing, "Options", None)
    if inspect.isclass(own) and issubclass(own, Options):
        return own
    for base in thing.__mro__:
        for generic in base.__dict__.get("__orig_bases__", ()):
            for argument in get_args(generic):
                if inspect.isclass(argument) and issubclass(argument, Options):
                    return argument
    return None


def _options_of(thing: Any, what: str, inputs: int) -> Options:
    """Options with a field for each parameter of a signature, without the inputs."""
    if inspect.isclass(thing) and thing.__init__ is object.__init__:
        return Options()
    fields = []
    named = [
        p for p in signature_of(thing).parameters.values() if p.kind not in (p.VAR_POSITIONAL, p.VAR_KEYWORD)
    ]
    known = meanings(thing)
    for parameter in named[inputs:]:
        if type(parameter.default) not in _READ:
            raise ConfigError(
                f"{what}: its parameter {parameter.name!r} needs a default that is a flag, a number or a text"
            )
        kind = type(parameter.default)
        fields.append((parameter.name, kind, option(parameter.default, known.get(parameter.name, ""))))
    made: type[Options] = dataclasses.make_dataclass(
        f"{getattr(thing, '__name__', 'Own')}Options", fields, bases=(Options,), frozen=True, kw_only=True
    )
    return made()
