"""Errors that say what is wrong, where, and what to do about it.

Everything the package raises on purpose derives from `LayoutExploreError`, so that a caller can catch one
class; the children also derive from the built-in exception that fits, so that ordinary `except ValueError`
keeps working.
"""

from __future__ import annotations

import difflib
import importlib
import reprlib
from collections.abc import Iterable
from types import ModuleType
from typing import Any


class LayoutExploreError(Exception):
    """Base of every error that layoutexplore raises on purpose."""


class MapError(LayoutExploreError, ValueError):
    """A grid or floor plan cannot be read, written or used: broken file, no free space, bad resolution."""


class MapWarning(UserWarning):
    """A grid or floor plan was read, but not everything in it could be taken at its word."""


class ConfigError(LayoutExploreError, ValueError):
    """An option is unknown or has a value that makes no sense."""


class UnknownNameError(ConfigError):
    """No agent, sensor, plan, method, ... of that name; the message suggests the closest ones."""


class StartError(LayoutExploreError, ValueError):
    """The robot cannot start there: inside a wall, outside the plan, or too close to an obstacle."""


class ResultsError(LayoutExploreError, ValueError):
    """An output folder or result file belongs to something else, or is damaged."""


class WriteError(MapError, ResultsError):
    """A file cannot be written: no permission, no space, or something else has its name."""


class WorkerError(LayoutExploreError, RuntimeError):
    """A worker process of a vector environment died or does not answer."""


class OwnCodeError(LayoutExploreError, RuntimeError):
    """A user's own agent, predictor or layout method fails; the message ends with its traceback."""


class MissingExtraError(LayoutExploreError, ImportError):
    """An optional dependency is not installed; the message names the pip line that brings it."""


_SHORT = reprlib.Repr()
_SHORT.maxlevel, _SHORT.maxstring, _SHORT.maxother = 3, 120, 120
_SHORT.maxlist = _SHORT.maxtuple = _SHORT.maxdict = _SHORT.maxset = 8
_LONGEST, _LONGEST_CAUSE = 300, 500
_MOST_NAMES, _LONGEST_NAME = 60, 100


def shortened(value: Any) -> str:
    """A value as a message shows it: like `repr`, but of a length that can be read, however large it is.

    Example:
        >>> shortened([1, "x"]), len(shortened(["x" * 10_000] * 10_000)) <= 320
        ("[1, 'x']", True)
    """
    try:
        text = _SHORT.repr(value)
    except Exception:  # whole numbers of thousands of digits, and objects that cannot show themselves
        return f"a value of type {type(value).__name__} that is too large to show"
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}..."


def cause(error: BaseException) -> str:
    """What an error says, for the message of another: on one line, of a length that can be read.

    Example:
        >>> cause(ValueError(" no  room")), len(cause(TypeError("x" * 9000)))
        ('no room', 503)
    """
    text = " ".join(str(error).split()) or type(error).__name__
    return text if len(text) <= _LONGEST_CAUSE else f"{text[:_LONGEST_CAUSE]}..."


def unknown_name(kind: str, name: str, known: Iterable[str]) -> UnknownNameError:
    """The error for a name that does not exist, with the closest known names.

    Args:
        kind: What was looked up, in the singular: "agent", "sensor".
        name: The name that was given.
        known: All names that exist.

    Example:
        >>> str(unknown_name("sensor", "stagee", ["stage", "indoor"]))
        "unknown sensor 'stagee': did you mean 'stage'? Known: indoor, stage"
    """
    names = sorted(known)
    close = difflib.get_close_matches(name[:100], [n for n in names if len(n) <= 100], n=3, cutoff=0.5)
    hint = f": did you mean {' or '.join(repr(c) for c in close)}? Known" if close else "; known"
    listed = [n if len(n) <= _LONGEST_NAME else f"{n[:_LONGEST_NAME]}..." for n in names[:_MOST_NAMES]]
    more = f" and {len(names) - _MOST_NAMES} more" if len(names) > _MOST_NAMES else ""
    return UnknownNameError(f"unknown {kind} {shortened(name)}{hint}: {', '.join(listed)}{more}")


def require(module: str, extra: str) -> ModuleType:
    """Import an optional dependency, or say which extra brings it.

    Args:
        module: The module's import name.
        extra: The extra of this package that installs it.

    Raises:
        MissingExtraError: The module is not installed.
    """
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        raise MissingExtraError(
            f"{error.name} is not installed: pip install 'layoutexplore[{extra}]'"
        ) from error
