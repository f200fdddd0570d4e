"""What a document must hold: a schema is a nest of these, and the first value that does not fit is named.

Each has a method `fit(value, place)` that returns the value, as plain numbers, tuples and texts, or raises
`MisfitError`. The place of a value is written as in Python: `features[3].geometry`; where it is None,
the error names none.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

from layoutexplore.errors import shortened


class MisfitError(ValueError):
    """A value that does not fit."""


class Schema(Protocol):
    """What a value must be."""

    def fit(self, value: Any, place: str | None = "") -> Any:
        """The value, or `MisfitError`."""


def misfit(place: str | None, expected: str, value: Any) -> MisfitError:
    """The error for a value: where it is, what is expected there, what was found."""
    return MisfitError(f"{_shown(place) or 'the document'} must be {expected}, got {shortened(value)}")


@dataclass(frozen=True, kw_only=True)
class Number:
    """A finite number; a flag is none."""

    low: float = -1e300
    high: float = 1e300
    whole: bool = False

    def fit(self, value: Any, place: str | None = "") -> float:
        """The number."""
        kinds = (int,) if self.whole else (int, float)
        good = isinstance(value, kinds) and not isinstance(value, bool)
        if not good or not self.low <= value <= self.high or not math.isfinite(value):
            raise misfit(place, str(self), value)
        return value  # type: ignore[no-any-return]

    def __str__(self) -> str:
        bounds = [f"at least {self.low:.15g}"] if self.low > -1e300 else []
        bounds += [f"at most {self.high:.15g}"] if self.high < 1e300 else []
        kind = "a whole number" if self.whole else "a finite number"
        return f"{kind} of {' and '.join(bounds)}" if bounds else kind


@dataclass(frozen=True, kw_only=True)
class Text:
    """A text of at most `most` characters, or one of `choices`."""

    most: int = 10_000
    choices: tuple[str, ...] = ()

    def fit(self, value: Any, place: str | None = "") -> str:
        """The text."""
        if not isinstance(value, str) or len(value) > self.most:
            raise misfit(place, f"a text of at most {self.most} characters", value)
        if self.choices and value not in self.choices:
            raise misfit(place, f"one of {', '.join(self.choices)}", value)
        return value


@dataclass(frozen=True)
class Flag:
    """True or false."""

    def fit(self, value: Any, place: str | None = "") -> bool:
        """The flag."""
        if not isinstance(value, bool):
            raise misfit(place, "true or false", value)
        return value


@dataclass(frozen=True)
class Items:
    """A list of so many values of one kind."""

    of: Schema
    least: int = 0
    most: float = math.inf

    def fit(self, value: Any, place: str | None = "") -> list[Any]:
        """The values."""
        if not isinstance(value, list | tuple) or not self.least <= len(value) <= self.most:
            bounds = f"{self.least} or more" if self.most == math.inf else f"{self.least} to {self.most:g}"
            count = bounds if self.least != self.most else f"{self.least}"
            raise misfit(place, f"a list of {count} values", value)
        if place is not None:
            with contextlib.suppress(MisfitError):  # to name places takes longer than all the rest
                return self.fit(value, None)
            return [self.of.fit(item, f"{place}[{k}]") for k, item in enumerate(value)]
        return [self.of.fit(item, None) for item in value]


@dataclass(frozen=True)
class TableOf:
    """A table with any keys and values of one kind."""

    of: Schema

    def fit(self, value: Any, place: str | None = "") -> dict[str, Any]:
        """The values by key."""
        if not isinstance(value, Mapping):
            raise misfit(place, "a table", value)
        return {
            Text().fit(key, f"a key of {place}"): self.of.fit(v, _inside(place, key))
            for key, v in value.items()
        }


@dataclass(frozen=True)
class Record:
    """A table with keys that must be there, and some that may be; others fit `others`, or are kept."""

    required: Mapping[str, Schema]
    optional: Mapping[str, Schema] = field(default_factory=dict)
    others: Schema | None = None

    def fit(self, value: Any, place: str | None = "") -> dict[str, Any]:
        """The values by key; what is optional and null is left out."""
        if not isinstance(value, Mapping):
            raise misfit(place, "a table", value)
        for key in self.required:
            if key not in value:
                raise MisfitError(f"the entry {key!r} is missing{f' in {_shown(place)}' if place else ''}")
        known = {**self.optional, **self.required}
        return {
            key: schema.fit(part, _inside(place, key)) if (schema := known.get(key, self.others)) else part
            for key, part in value.items()
            if not (part is None and key in self.optional)
        }


@dataclass(frozen=True)
class Anything:
    """Any value."""

    def fit(self, value: Any, place: str | None = "") -> Any:
        """The value."""
        return value


def _shown(place: str | None) -> str:
    """A place as messages name it: where its keys are very long, its beginning and its end."""
    place = place or ""
    return place if len(place) <= 200 else f"{place[:100]}...{place[-100:]}"


def _inside(place: str | None, key: Any) -> str | None:
    return place if place is None else f"{place}.{key}" if place else str(key)
