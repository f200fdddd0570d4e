"""Errors that say what is wrong, where, and what to do about it.

Everything the package raises on purpose derives from `LayoutExploreError`, so that a caller can catch one
class; the children also derive from the built-in exception that fits, so that ordinary `except ValueError`
keeps working.
"""

from __future__ import annotations

import builtins
import difflib
import functools
import importlib
import inspect
import reprlib
import sys
import types
import typing
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import islice
from pathlib import PurePath
from types import ModuleType
from typing import Any, ParamSpec, TypeVar, cast

import numpy as np
from numpy.typing import ArrayLike

P = ParamSpec("P")
R = TypeVar("R")
C = TypeVar("C", bound=type)

_HALF_MESSAGE = 1450
"""Characters kept of either end of a longer message: more than a traceback that is told has (`plugins`)."""


class LayoutExploreError(Exception):
    """Base of every error that layoutexplore raises on purpose.

    Of a message that nobody could read, because it names something of thousands of characters, the middle is
    left out.

    Example:
        >>> len(str(LayoutExploreError("x" * 10_000)))
        2907
    """

    def __str__(self) -> str:
        text = super().__str__()
        if len(text) <= 2 * _HALF_MESSAGE + 7:
            return text
        return f"{text[:_HALF_MESSAGE]} [...] {text[-_HALF_MESSAGE:]}"


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


def counted(count: int, noun: str) -> str:
    """A number of things, in words for a message.

    Example:
        >>> counted(1, "room"), counted(2, "door")
        ('1 room', '2 doors')
    """
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


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


def unknown_name(kind: str, name: object, known: Iterable[str]) -> UnknownNameError:
    """The error for a name that does not exist, with the closest known names.

    Args:
        kind: What was looked up, in the singular: "agent", "sensor".
        name: The name that was given; whatever it is.
        known: All names that exist.

    Example:
        >>> str(unknown_name("sensor", "stagee", ["stage", "indoor"]))
        "unknown sensor 'stagee': did you mean 'stage'? Known: indoor, stage"
    """
    names = sorted(known)
    text = name if type(name) is str else shortened(name)
    close = difflib.get_close_matches(text[:100], [n for n in names if len(n) <= 100], n=3, cutoff=0.5)
    if not names:
        return UnknownNameError(f"unknown {kind} {shortened(name)}: there is none at all")
    hint = f": did you mean {' or '.join(repr(c) for c in close)}? Known" if close else "; known"
    listed = [n if len(n) <= _LONGEST_NAME else f"{n[:_LONGEST_NAME]}..." for n in names[:_MOST_NAMES]]
    more = f" and {len(names) - _MOST_NAMES} more" if len(names) > _MOST_NAMES else ""
    return UnknownNameError(f"unknown {kind} {shortened(name)}{hint}: {', '.join(listed)}{more}")


_NUMBERS: dict[Any, tuple[type, ...]] = {
    float: (float, int, np.floating, np.integer),
    int: (int, np.integer),
    bool: (bool, np.bool_),
}
_LARGEST = 1e18
"""A number beyond it is no length, index or count."""
_SPEAKS_FOR_ITSELF = (OSError, AssertionError, NameError, ImportError, NotImplementedError)
"""What the system refuses says why, and the others are faults of code: no unusual value explains them."""


def checks_calls(cls: C) -> C:
    """A class whose public methods, and whose making, do what `checks_arguments` does."""
    for name, method in list(vars(cls).items()):
        if inspect.isfunction(method) and (name == "__init__" or not name.startswith("_")):
            setattr(cls, name, checks_arguments(method))
    return cls


def checks_making(cls: C) -> C:
    """A class whose making does what `checks_arguments` does; its methods, called all the time, do not."""
    cls.__init__ = checks_arguments(cls.__init__)  # type: ignore[misc]
    return cls


def checks_arguments(function: Callable[P, R]) -> Callable[P, R]:
    """A function whose plain errors name the argument that is of another kind than it is annotated with.

    Called from outside of the package, also one that can hardly be meant: no number, far too large, empty.
    Calls that succeed cost nothing; an error that no argument explains stays: it is a fault of the package.

    Example:
        >>> @checks_arguments
        ... def half(length: float) -> float:
        ...     return length / 2
        >>> half("x")
        Traceback (most recent call last):
        ...
        layoutexplore.errors.ConfigError: half: length must be float, got 'x'
    """

    @functools.wraps(function)
    def checked(*args: P.args, **kwargs: P.kwargs) -> R:
        try:
            return function(*args, **kwargs)
        except Exception as error:  # also those of Numba, OpenCV and Shapely
            _explain(error, function, args, kwargs, outside=_from_outside())
            raise

    @functools.wraps(function)
    def walked(*args: P.args, **kwargs: P.kwargs) -> Any:
        try:
            yield from cast(Iterable[Any], function(*args, **kwargs))
        except Exception as error:
            _explain(error, function, args, kwargs, outside=_from_outside())
            raise

    return cast(Callable[P, R], walked) if inspect.isgeneratorfunction(function) else checked


@checks_arguments
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


def _from_outside() -> bool:
    """Whether a checked function is not called by this package; its commands count as users."""
    package, _, room = str(sys._getframe(2).f_globals.get("__name__", "")).partition(".")
    return package != __name__.partition(".")[0] or room.startswith("cli")


def _explain(
    error: Exception, function: Callable[..., Any], args: Any, kwargs: dict[str, Any], outside: bool
) -> None:
    """Raise an error naming the argument that explains this one (last a float: inf), or the Ctrl-C behind."""
    behind: BaseException | None = error
    while isinstance(behind, SystemError):  # Numba's: Ctrl-C came as a kernel handed out its results
        behind = behind.__cause__
    if isinstance(behind, KeyboardInterrupt):
        raise KeyboardInterrupt from error
    if isinstance(error, LayoutExploreError):
        return
    given = _given(function, args, kwargs)
    for name, (value, meant, annotation) in sorted(given.items(), key=lambda g: isinstance(g[1][0], float)):
        unlike = getattr(error, "obj", None) is value and type(value).__name__ not in annotation
        if unlike or not _can_be(value, meant):
            told = f"{function.__qualname__}: {name} must be {annotation}, got {_shown(value)}"
            raise ConfigError(told) from error
    # What this package itself has passed on explains nothing: the fault may be here.
    if not outside or isinstance(error, _SPEAKS_FOR_ITSELF):
        return
    for name, (value, meant, _) in given.items():
        if odd := _oddity(value, meant, error):
            told = f"{function.__qualname__}: {name} {odd}, which leads nowhere: {cause(error)}"
            raise ConfigError(told) from error


def _given(
    function: Callable[..., Any], args: tuple[Any, ...], kwargs: dict[str, Any]
) -> dict[str, tuple[Any, Any, str]]:
    """Value, kind and annotation of the arguments; none where they do not fit the signature.

    Those that are the default explain nothing.
    """
    signature = inspect.signature(function)
    try:
        given = signature.bind(*args, **kwargs).arguments
    except TypeError:
        return {}
    found: dict[str, tuple[Any, Any, str]] = {}
    for name in filter(given.__contains__, function.__annotations__):  # not of `self`: it has none
        kind, value, parameter = function.__annotations__[name], given[name], signature.parameters[name]
        default = parameter.default
        if value is default or (isinstance(value, (str, int, float)) and repr(value) == repr(default)):
            continue
        try:
            meant = eval(kind, {}, _Names(function.__globals__)) if isinstance(kind, str) else kind
        except Exception:  # of a module imported for type checkers alone, or no Python at all
            continue
        each = value if parameter.kind is parameter.VAR_KEYWORD else {name: value}
        if parameter.kind is parameter.VAR_POSITIONAL:
            each = {f"{name}[{k}]": one for k, one in enumerate(value)}
        found |= {key: (one, meant, str(kind)) for key, one in each.items()}
    return found


class _Names(dict[str, Any]):
    """What names in annotations mean; those imported for type checkers alone are kinds without a class."""

    def __missing__(self, name: str) -> Any:
        return getattr(builtins, name, None) or type(name, (_Elsewhere,), {})


class _Elsewhere:
    """A class that is not loaded: nothing of Python's own or NumPy's is of it."""


def _shown(value: Any) -> str:
    """A value for a message; of an array its kind and shape."""
    large = isinstance(value, np.ndarray) and value.size > 8
    return f"{value.dtype} {value.shape}" if large else shortened(value)


def _oddity(value: Any, meant: Any, error: Exception) -> str:
    """What can hardly be meant of a value that is of the right kind; empty where nothing is."""
    if isinstance(value, (int, float, np.integer, np.floating)):
        most = 1e5 if isinstance(error, (MemoryError, OverflowError)) else 1e12
        return "" if abs(cast(Any, value)) <= most else f"is {shortened(value)}"
    if isinstance(value, PurePath) and "\0" in str(value):
        return f"is {shortened(str(value))}"
    with suppress(Exception):  # what can be looked at and tells, as a `Decision` does, what is wrong with it
        if told := getattr(value, "fault", ""):
            return str(told)
    if isinstance(value, Iterator):
        return "" if typing.get_origin(meant) is Iterable else "is a generator"
    if isinstance(value, range):
        return f"is {value}" if len(value) > 1e6 else ""
    if isinstance(value, (bytearray, list, tuple)) and typing.get_origin(meant) is np.ndarray:
        return "is no array"
    if isinstance(value, (str, bytes, bytearray, list, tuple, dict)):
        return "" if value else "is empty"
    if not isinstance(value, np.ndarray):
        return ""
    wanted = typing.get_args(typing.get_args(meant)[-1:][0])[:1] if typing.get_args(meant) else ()
    if wanted and isinstance(wanted[0], type) and not issubclass(value.dtype.type, wanted[0]):
        return f"has values of type {value.dtype}, not {wanted[0].__name__},"
    if value.dtype.kind in "fc" and not np.isfinite(value).all():
        return "has values that are no numbers"
    return "" if value.size else f"has the shape {value.shape}"


def _can_be(value: Any, meant: Any) -> bool:
    """As `_fits`; an object that raises when it is looked at fits nowhere."""
    with suppress(Exception):
        return _fits(value, meant)
    return False


def _fits(value: Any, meant: Any) -> bool:
    """Whether a value can be what an annotation says; where nobody can tell, it can."""
    number: Any = value
    origin, parts = typing.get_origin(meant), typing.get_args(meant)
    if meant in _NUMBERS:
        return isinstance(value, _NUMBERS[meant]) and bool(abs(number) <= _LARGEST)
    if origin is np.ndarray or meant == ArrayLike:
        flags = bool(parts) and parts[-1] == np.dtype[np.bool_]
        return _is_array(value) and not (flags and np.asarray(value).dtype.kind == "f")
    if origin in (typing.Union, types.UnionType):
        return any(_fits(value, part) for part in parts)
    base = origin or meant
    if origin is typing.Literal:
        return value in parts
    if base is Any or not isinstance(base, type):
        return meant is not None or value is None
    if getattr(base, "_is_protocol", False):
        names = [*vars(base), *getattr(base, "__annotations__", ())]
        return all(hasattr(value, name) for name in names if not name.startswith("_"))
    if issubclass(base, _Elsewhere):
        return type(value).__module__ not in ("builtins", "numpy", "pathlib")
    if base is type and parts:
        return isinstance(value, type) and issubclass(value, parts[0])
    if isinstance(value, np.ndarray) and value.ndim == 0:
        return False  # no number of Python's, and nothing to go through
    if issubclass(base, tuple) and hasattr(base, "_fields"):
        alike = isinstance(value, tuple) and len(value) == len(base._fields) and _is_array(value)
        return isinstance(value, base) or alike
    if base is tuple and Ellipsis not in parts and isinstance(value, tuple):
        return len(value) == len(parts) and all(map(_fits, value, parts))
    if parts and base in (Iterable, Sequence) and isinstance(value, (str, bytes)):
        return parts[0] in (str, Any) and isinstance(value, str)
    if parts and base is Mapping and isinstance(value, Mapping):
        flat = {k: np.atleast_1d(v) if isinstance(v, np.ndarray) else v for k, v in value.items()}
        return all(_fits(key, parts[0]) and _fits(item, parts[1]) for key, item in flat.items())
    if parts and base in (Iterable, Sequence, list) and isinstance(value, Collection):
        return isinstance(value, base) and all(_fits(item, parts[0]) for item in islice(value, 1000))
    return isinstance(value, base)


def _is_array(value: Any) -> bool:
    """Whether a value is an array of numbers or flags, or nested lists of them."""
    if isinstance(value, range):
        return False  # takes no memory, as an array a lot
    try:
        array = np.asarray(value)
    except Exception:  # whatever an object raises that is asked for its numbers
        return False
    return array.dtype.kind in "biuf" and array.ndim > 0 and (array.size > 0 or array is value)
