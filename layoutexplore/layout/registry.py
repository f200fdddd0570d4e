"""The layout methods by name, each with one frozen configuration dataclass.

A method's module calls `register_method` as a decorator; the module is imported when the method is first
asked for, so that `import layoutexplore` stays cheap.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from numbers import Integral, Real
from typing import Any, TypeVar

from layoutexplore.errors import ConfigError, unknown_name
from layoutexplore.grids.grid import OccupancyGrid
from layoutexplore.layout.types import Layout

ConfigT = TypeVar("ConfigT")
Run = Callable[[OccupancyGrid, Any], Layout]

METHOD_MODULES: dict[str, str] = {
    "default": "layoutexplore.layout.merging.method",
    "rose2": "layoutexplore.layout.lines.rose2",
    "ias15": "layoutexplore.layout.lines.ias15",
    "rose": "layoutexplore.layout.lines.rose",
    "morphological": "layoutexplore.layout.survey.methods",
    "distance": "layoutexplore.layout.survey.methods",
    "voronoi": "layoutexplore.layout.survey.methods",
}
"""Where each method lives."""


@dataclass(frozen=True)
class LayoutMethod:
    """A named way to turn a grid into a layout."""

    name: str
    config_class: type[Any]
    run: Run

    def config(self, config: Any = None) -> Any:
        """The configuration to run with: the default, the given one, or the default changed by a mapping.

        Raises:
            ConfigError: An unknown key, a value of another kind than the default's, or a configuration of
                another method.
        """
        if config is None:
            return self.config_class()
        defaults = {f.name: f.default for f in fields(self.config_class)}
        if isinstance(config, self.config_class):
            self._check({name: getattr(config, name) for name in defaults}, defaults)
            return config
        if isinstance(config, dict):
            self._check(config, defaults)
            return replace(self.config_class(), **config)
        raise ConfigError(
            f"the {self.name} method takes a {self.config_class.__name__}, got {type(config).__name__}"
        )

    def _check(self, options: Mapping[str, Any], defaults: Mapping[str, Any]) -> None:
        for name, value in options.items():
            if name not in defaults:
                raise unknown_name(f"option of the {self.name} method", str(name), defaults)
            if not _is_like(value, defaults[name]):
                kind = _KINDS.get(type(defaults[name]), "a finite number")
                raise ConfigError(
                    f"the {self.name} method's {name} must be {kind}, such as {defaults[name]}; got {value!r}"
                )


_KINDS = {bool: "True or False", int: "a whole number", tuple: "finite numbers in a tuple"}


def _is_like(value: Any, default: Any) -> bool:
    """Whether a value is of the kind of an option's default: a flag, finite numbers, whole ones where the default is whole."""
    if isinstance(default, tuple):
        return isinstance(value, tuple) and len(value) == len(default) and all(map(_is_like, value, default))
    if isinstance(default, bool) or isinstance(value, bool):
        return isinstance(default, bool) and isinstance(value, bool)
    if default is None and value is None:
        return True
    return isinstance(value, Integral if isinstance(default, int) else Real) and math.isfinite(value)


_METHODS: dict[str, LayoutMethod] = {}


def register_method(
    name: str, config_class: type[ConfigT]
) -> Callable[[Callable[[OccupancyGrid, ConfigT], Layout]], Callable[[OccupancyGrid, ConfigT], Layout]]:
    """Decorate `run(grid, config) -> Layout` to make it a method of `reconstruct`.

    Args:
        name: The method's name.
        config_class: A frozen dataclass whose every field has a default.
    """
    if not is_dataclass(config_class):
        raise TypeError(f"{config_class.__name__} is not a dataclass")

    def decorate(
        run: Callable[[OccupancyGrid, ConfigT], Layout],
    ) -> Callable[[OccupancyGrid, ConfigT], Layout]:
        _METHODS[name] = LayoutMethod(name, config_class, run)
        return run

    return decorate


def layout_method(name: str) -> LayoutMethod:
    """The method of that name.

    Raises:
        UnknownNameError: There is none.
    """
    if name not in _METHODS and name in METHOD_MODULES:
        importlib.import_module(METHOD_MODULES[name])
    if name not in _METHODS:
        raise unknown_name("layout method", name, method_names())
    return _METHODS[name]


def method_names() -> list[str]:
    """Every method, the default first."""
    return [*METHOD_MODULES, *(name for name in _METHODS if name not in METHOD_MODULES)]
