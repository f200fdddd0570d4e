"""Options: which values a configuration takes; reading them from tables and from `NAME:key=value,...`.

A configuration is a frozen dataclass that calls `check` in its `__post_init__`. What is chosen by a text on
the command line, an agent or a predictor, has its parameters in a child of `Options` and is read by
`parse_options`.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from numbers import Integral, Real
from typing import Any, TypeVar

import numpy as np

from layoutexplore.errors import ConfigError, UnknownNameError, cause, shortened, unknown_name

T = TypeVar("T")

Value = bool | int | float | str

_ONE = {bool: "true or false", int: "a whole number", float: "a number", str: "a text", dict: "a table"}
_MANY = {bool: "flags", int: "whole numbers", float: "numbers", str: "names"}


@dataclass(frozen=True, kw_only=True)
class Rule:
    """Which values an option may have. A number may be one of NumPy's, but never NaN; a flag is no number.

    Attributes:
        kind: bool, int, float (whole numbers included), str or dict.
        low: Least number.
        high: Greatest number.
        above: All numbers are greater than this.
        below: All numbers are less than this.
        choices: The only texts; any when empty.
        optional: Whether None is a value, too.
        count: So many values in a tuple or list, any number of them when -1; None for a single value.
        finite: Whether infinity is refused, too.
    """

    kind: type = float
    low: float = -math.inf
    high: float = math.inf
    above: float = -math.inf
    below: float = math.inf
    choices: tuple[str, ...] = ()
    optional: bool = False
    count: int | None = None
    finite: bool = True

    def __str__(self) -> str:
        limits = [
            f"{self.low:g} or more" if self.low > -math.inf else "",
            f"above {self.above:g}" if self.above > -math.inf else "",
            f"at most {self.high:g}" if self.high < math.inf else "",
            f"below {self.below:g}" if self.below < math.inf else "",
        ]
        bounds = " and ".join(limit for limit in limits if limit)
        if self.low > -math.inf and self.high < math.inf:
            bounds = f"from {self.low:g} to {self.high:g}"
        elif self.low > -math.inf:
            bounds = f", {bounds}"
        if self.count is not None:
            what = f"a list of {'' if self.count < 0 else f'{self.count} '}{_MANY[self.kind]}"
        else:
            what = _ONE[self.kind]
            if (
                self.kind is float
                and self.finite
                and not (math.isfinite(self.low) and math.isfinite(self.high))
            ):
                what = "a finite number"
        return f"{what} {bounds}".replace(" ,", ",").rstrip()

    def convert(self, name: str, value: Any) -> Any:
        """The value, NumPy's numbers as Python's own, a list or an array of one dimension as a tuple.

        Raises:
            ConfigError: The value is not allowed; the message begins with the option's name.
        """
        if value is None and self.optional:
            return None
        if self.count is None:
            good = self._allows(value)
        else:
            if isinstance(value, np.ndarray) and value.ndim == 1:
                value = value.tolist()
            good = isinstance(value, (tuple, list)) and self.count in (-1, len(value))
            good = good and all(map(self._allows, value))
        if not good:
            raise ConfigError(f"{name} must be {self}, got {shortened(value)}")
        values = (value,) if self.count is None else value
        for text in values if self.choices else ():
            if text not in self.choices:
                raise unknown_name(name, text, self.choices)
        plain = tuple(item.item() if isinstance(item, np.generic) else item for item in values)
        return plain[0] if self.count is None else plain

    def _allows(self, value: Any) -> bool:
        if self.kind not in (int, float):
            return isinstance(value, (bool, np.bool_) if self.kind is bool else self.kind)
        if isinstance(value, bool) or not isinstance(value, Integral if self.kind is int else Real):
            return False
        try:
            number = float(value)
        except OverflowError:
            return False
        if not math.isfinite(number) and (self.finite or math.isnan(number)):
            return False
        if math.isinf(number):
            return self.low <= number <= self.high
        return self.low <= number <= self.high and self.above < number < self.below


def check_kind(name: str, value: object, *kinds: type, optional: bool = False) -> None:
    """See whether an argument is of one of these types, or None where it may be left out.

    Args:
        name: Of the argument.
        value: What was given.
        kinds: The types.
        optional: Whether None is allowed.

    Raises:
        ConfigError: It is not.

    Example:
        >>> check_kind("seed", 3, int)
    """
    if isinstance(value, kinds) or (optional and value is None):
        return
    articles = ["an" if kind.__name__[0] in "AEIOaeio" else "a" for kind in kinds]
    words = [f"{a} {kind.__name__}" for a, kind in zip(articles, kinds, strict=True)] + ["None"] * optional
    raise ConfigError(f"{name} must be {' or '.join(words)}, got {shortened(value)}")


COUNT = Rule(kind=int, low=1)
POSITIVE = Rule(above=0.0)
NON_NEGATIVE = Rule(low=0.0)
SHARE = Rule(low=0.0, high=1.0)
FLAG = Rule(kind=bool)
NATURAL = Rule(kind=int, low=0)
SEED = NATURAL
KEPT_SEED = Rule(kind=int, low=0, high=9e18)
"""Of what is written into files: no number there has more than 64 bits."""

JOBS = Rule(kind=int, low=1, high=1024)

POSE = Rule(count=3, low=-1e9, high=1e9)
"""(x, y, theta), in metres and radians."""


def rule_like(default: Any) -> Rule:
    """The rule of which a default is an example: as many numbers as it has, names, None or a number."""
    if default is None:
        return Rule(optional=True)
    if isinstance(default, (tuple, list)):
        kinds = {type(item) for item in default}
        if kinds <= {str}:
            return Rule(kind=str, count=-1)
        return Rule(kind=int if kinds == {int} else float, count=len(default))
    return Rule(kind=type(default))


def rule_of(field: dataclasses.Field[Any]) -> Rule:
    """The rule in a field's metadata, or the one that its default is an example of."""
    rule = field.metadata.get("rule")
    return rule if isinstance(rule, Rule) else rule_like(field.default)


def check_fields(config: object) -> None:
    """Check every field of a frozen dataclass by its own rule (`rule_of`), as `check` does.

    Raises:
        ConfigError: A value is of another kind than its field's default, or not allowed.
    """
    fields = dataclasses.fields(config)  # type: ignore[arg-type]
    check(config, **{field.name: rule_of(field) for field in fields})


def check(config: object, prefix: str = "", /, **rules: Rule) -> None:
    """Check fields of a frozen dataclass, each by its rule; NumPy's numbers become Python's own.

    Args:
        config: The configuration that is being made.
        prefix: What stands before a field's name in a message.
        rules: By the fields' names.

    Raises:
        ConfigError: A value is not allowed.
    """
    for name, rule in rules.items():
        object.__setattr__(config, name, rule.convert(prefix + name, getattr(config, name)))


def make_floats(config: object) -> None:
    """Whole numbers in those fields of a frozen dataclass that are floats become such: equals are told alike.

    Example:
        >>> @dataclasses.dataclass(frozen=True)
        ... class Move:
        ...     metres: float
        >>> make_floats(move := Move(2))
        >>> move
        Move(metres=2.0)
    """
    for field in dataclasses.fields(config):  # type: ignore[arg-type]
        value = getattr(config, field.name)
        kind = getattr(field.type, "__name__", str(field.type))
        if kind.startswith("float") and isinstance(value, int):
            object.__setattr__(config, field.name, float(value))


def check_keys(table: Any, known: Iterable[str], where: str) -> None:
    """Raise `ConfigError` unless it is a table with known keys only; the closest known ones are suggested."""
    if not isinstance(table, Mapping):
        raise ConfigError(f"expected a table in {where}, got {shortened(table)}")
    known = list(known)
    for key in table:
        if key not in known:
            raise unknown_name(f"key in {where}:", str(key), known)


def from_table(kind: type[T], table: Any, where: str) -> T:
    """A configuration from a table of a TOML file; lists become tuples.

    Args:
        kind: Its dataclass.
        table: Values of its fields.
        where: File and table, for messages.

    Raises:
        UnknownNameError: There is no such key; the closest ones are suggested.
        ConfigError: A key is missing, or a value makes no sense.
    """
    fields = dataclasses.fields(kind)  # type: ignore[arg-type]
    check_keys(table, [f.name for f in fields], where)
    needed = [f.name for f in fields if f.default is f.default_factory is dataclasses.MISSING]
    if lacking := [name for name in needed if name not in table]:
        raise ConfigError(f"{where}: missing {' and '.join(lacking)}")
    try:
        return kind(**{key: tuple(v) if isinstance(v, list) else v for key, v in table.items()})
    except ConfigError as error:
        raise type(error)(f"{where}: {error}") from error
    except TypeError as error:
        raise ConfigError(f"{where}: {cause(error)}") from error


def option(
    default: Value,
    text: str,
    *,
    low: float = -math.inf,
    high: float = math.inf,
    choices: tuple[str, ...] = (),
    positional: bool = False,
    whole: bool = False,
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
        whole: Whether everything behind the colon is the value; for the only parameter.
    """
    rule = Rule(kind=type(default), low=low, high=high, choices=choices)
    marks = {"text": text, "rule": rule, "positional": positional or whole, "whole": whole}
    return dataclasses.field(default=default, metadata=marks)


@dataclass(frozen=True, kw_only=True)
class Options:
    """Parameters of what is chosen by name; subclasses add fields made by `option`.

    Raises:
        ConfigError: A value has the wrong type or lies outside what makes sense.
    """

    def __post_init__(self) -> None:
        check_fields(self)


def parse_options(what: str, spec: str, name: str, text: str | None, defaults: Any) -> Any:
    """Options from what stands behind `NAME:`, each of the type of its default.

    Args:
        what: What is chosen, for messages.
        spec: The whole text, for messages.
        name: The name in it.
        text: What stands behind its colon; None without one.
        defaults: The options there are: a frozen dataclass whose every field has a default.

    Raises:
        UnknownNameError: There is no such parameter; the closest ones are suggested.
        ConfigError: The text is not of that form, or a value makes no sense.
    """
    if text is None:
        return defaults
    if not text.strip():
        form = f"write {name!r} or NAME:key=value,key=value"
        raise ConfigError(f"{what} {shortened(spec)}: nothing follows the colon; {form}")
    fields = {field.name: field for field in dataclasses.fields(defaults)}
    first = next((key for key, field in fields.items() if field.metadata.get("positional")), "")
    whole = bool(first) and fields[first].metadata["whole"]
    # Semicolons do as well, so that parameters can stand inside another text's; behind a colon they are its.
    items = [text] if whole else (text if ":" in text else text.replace(";", ",")).split(",")
    if whole or (first and items[0].partition("=")[0].strip() not in fields):
        items[0] = f"{first}={items[0]}"
    values: dict[str, Value] = {}
    pairs = split_pairs(f"{what} {shortened(spec)}", items)
    for key, value in pairs.items():
        if key not in fields:
            if not fields:
                raise ConfigError(f"{what} {shortened(spec)}: it has no parameters")
            unknown = unknown_name(f"parameter of {what} {shortened(name)}", key, fields)
            raise UnknownNameError(f"{unknown}{_semicolon_hint(pairs, key)}")
        values[key] = read_value(f"{what} {shortened(spec)}: {key}", getattr(defaults, key), value)
    try:
        return dataclasses.replace(defaults, **values)
    except ConfigError as error:
        raise ConfigError(f"{what} {shortened(spec)}: {error}") from None


def _semicolon_hint(pairs: dict[str, str], key: str) -> str:
    """What to write where an unknown key is meant for a value with parameters of its own; empty for none."""
    nested = next((f"{owner}={value}" for owner, value in pairs.items() if ":" in value), "")
    if not nested:
        return ""
    meant = shortened(f"{nested};{key}={pairs[key]}")
    return f"; parameters inside of a parameter stand behind semicolons: {meant}"


def split_pairs(where: str, items: Iterable[str]) -> dict[str, str]:
    """Keys and values, stripped, of texts of the form `key=value`.

    Args:
        where: What the texts belong to, for messages.
        items: The texts.

    Raises:
        ConfigError: A text is not of that form, or a key is given twice.
    """
    pairs: dict[str, str] = {}
    for item in items:
        key, equals, value = (part.strip() for part in item.partition("="))
        if not (equals and key and value):
            raise ConfigError(f"{where}: {shortened(item.strip())} is not of the form key=value")
        if key in pairs:
            raise ConfigError(f"{where}: {shortened(key)} is given twice")
        pairs[key] = value
    return pairs


def format_spec(name: str, options: Any, defaults: Any) -> str:
    """The text `NAME:key=value,...`: parameters in their order, those that have their default left out."""
    fields = sorted(dataclasses.fields(options), key=lambda field: not field.metadata.get("positional"))
    changed = [
        ("" if field.metadata.get("positional") else f"{field.name}=")
        + format_value(getattr(options, field.name))
        for field in fields
        if getattr(options, field.name) != getattr(defaults, field.name)
    ]
    return f"{name}:{','.join(changed)}" if changed else name


def format_value(value: Value) -> str:
    """A value as it is written in a text; 1.0 is "1"."""
    if isinstance(value, bool):
        return str(value).lower()
    return repr(value).removesuffix(".0") if isinstance(value, float) else str(value)


def read_value(name: str, like: Value, text: str) -> Value:
    """The value of a text, of the type of another value.

    Raises:
        ConfigError: The text is no such value; the message begins with `name`.
    """
    kind = type(like)
    if kind not in _ONE:
        raise ConfigError(f"{name} cannot be written in a text: it is no flag, number or word")
    try:
        if kind is bool:
            return {"true": True, "false": False}[text.lower()]
        return kind(text)
    except (ValueError, KeyError):
        raise ConfigError(f"{name} must be {_ONE[kind]}, got {shortened(text)}") from None
