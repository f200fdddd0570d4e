"""JSON, YAML and TOML: decoded within limits, and checked before anybody looks inside.

A document is a nest of tables, lists, texts, flags and numbers. None is deeper or larger than the limits, no
text has characters that cannot be written again, and no whole number is larger than 64 bits hold.
"""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path
from typing import Any

from layoutexplore.errors import ConfigError, MapError, checks_arguments, shortened
from layoutexplore.files.limits import limits, raise_it
from layoutexplore.files.reading import Kind, read_text
from layoutexplore.files.schema import Anything, MisfitError, Schema

_LARGEST = 2**63
_NUMBERS = frozenset((int, float))
_DOTTED = re.compile(r"""(?<![\w"' \t-])(?:[\w"' \t-]++\.){50}""")
"""A key of more parts than any: the memory and time that its parser takes grow with their square."""


@checks_arguments
def read_json(path: Path, schema: Schema | None = None, *, error: Kind = MapError, what: str = "plan") -> Any:
    """What a JSON file holds.

    Args:
        path: The file.
        schema: What it must hold; anything when None.
        error: What is raised.
        what: What it is to be, for messages.

    Raises:
        LayoutExploreError: Of the kind `error`: it cannot be read, is no JSON, or does not fit.
    """
    return parse_json(read_text(path, error, what, limit="text_mb"), str(path), schema, error=error)


@checks_arguments
def parse_json(text: str, where: str, schema: Schema | None = None, *, error: Kind = MapError) -> Any:
    """What a JSON text holds; see `read_json`."""
    _check_count(sum(map(text.count, ",[{")), where, error)
    try:
        data = json.loads(text)
    except Exception as problem:  # also that of a number of 5 000 digits, or of lists too deep
        raise error(f"{where}: broken JSON: {_reason(problem)}") from problem
    return _checked(data, where, schema, error)


@checks_arguments
def read_toml(path: Path, schema: Schema | None = None, *, limit: str = "settings_mb") -> dict[str, Any]:
    """The tables of a TOML file, of a size that `limit` names.

    Raises:
        ConfigError: It cannot be read, is not valid TOML, or does not fit.
    """
    return parse_toml(read_text(path, ConfigError, "configuration", limit=limit), str(path), schema)


@checks_arguments
def parse_toml(
    text: str, where: str, schema: Schema | None = None, *, error: Kind = ConfigError
) -> dict[str, Any]:
    """The tables of a TOML text; see `read_toml`."""
    if _DOTTED.search(text):
        raise error(f"{where} is not valid TOML here: 50 or more words are joined by dots")
    try:
        data = tomllib.loads(text)
    except Exception as problem:
        raise error(f"{where} is not valid TOML: {_reason(problem)}") from problem
    table: dict[str, Any] = _checked(data, where, schema, error)
    return table


@checks_arguments
def read_yaml(path: Path, *, what: str = "map") -> Any:
    """What a YAML file holds; one with aliases is refused.

    Raises:
        MapError: It cannot be read, or is no YAML.
    """
    import yaml

    text, where = read_text(path, MapError, what, limit="settings_mb"), str(path)
    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    try:
        depth, nodes, deepest = 0, 0, limits().depth
        for event in yaml.parse(text, Loader=loader):
            if isinstance(event, yaml.AliasEvent):
                raise MapError(f"{where}: the alias *{shortened(event.anchor)} is not read: write it out")
            nodes += isinstance(event, yaml.NodeEvent)
            depth += isinstance(event, yaml.CollectionStartEvent)
            depth -= isinstance(event, yaml.CollectionEndEvent)
            if depth > deepest:
                _check_depth(depth, where, MapError)
        _check_count(nodes, where, MapError)
        data = yaml.load(text, Loader=loader)  # a safe loader: it makes nothing but plain values
    except MapError:
        raise
    except Exception as problem:
        raise MapError(f"{where}: broken YAML: {_reason(problem)}") from problem
    return _checked(data, where, None, MapError)


def _reason(problem: Exception) -> str:
    if isinstance(problem, RecursionError):
        return f"lists or tables are nested too deep (the limit is {limits().depth:g})"
    text = " ".join(str(problem).split())
    text = re.sub(r"; use sys\.set\w+\(\) to increase the limit", "", text)
    return shortened(text).strip("'\"") if len(text) > 300 else text or type(problem).__name__


def _check_count(count: int, where: str, error: Kind) -> None:
    if count > limits().nodes:
        raise error(
            f"{where}: holds about {count} values, and the limit nodes is {limits().nodes:g}: "
            f"{raise_it('nodes', count)}"
        )


def _check_depth(depth: int, where: str, error: Kind) -> None:
    if depth > limits().depth:
        raise error(
            f"{where}: lists or tables are nested too deep, and the limit depth is {limits().depth:g}: "
            "write it flatter"
        )


def _checked(data: Any, where: str, schema: Schema | None, error: Kind) -> Any:
    """The data as the schema gives it back."""
    _check_values(data, where, error)
    try:
        return (schema or Anything()).fit(data)
    except MisfitError as problem:
        raise error(f"{where}: {problem}") from problem


def _check_values(data: Any, where: str, error: Kind) -> None:
    """See that every value is plain, of a size that others can work with, and not too deep."""
    waiting: list[tuple[Any, int]] = [(data, 1)]
    allowed, count = limits(), 0
    while waiting:
        value, depth = waiting.pop()
        kind = type(value)
        if kind is dict or kind is list:
            count += len(value)
            if depth > allowed.depth:
                _check_depth(depth, where, error)
            if count > allowed.nodes:
                _check_count(count, where, error)
            if kind is dict:
                waiting.extend((key, depth) for key in value)
            elif _NUMBERS.issuperset(map(type, value)) and _all_moderate(value):
                continue
            waiting.extend((part, depth + 1) for part in (value.values() if kind is dict else value))
        elif kind is not float and (problem := _fault(value)):
            raise error(f"{where}: {shortened(value)}: {problem}")


def _all_moderate(numbers: list[float]) -> bool:
    """Whether all numbers are such as 64 bits hold; where one is not finite, this is not known."""
    return not numbers or (min(numbers) >= -_LARGEST and max(numbers) < _LARGEST)


def _fault(value: Any) -> str:
    """What is wrong with a single value; empty where nothing is."""
    kind = type(value)
    if kind is str:
        return "" if value.isascii() or _writable(value) else "half a character (a lone surrogate)"
    if kind is int:
        return "" if -_LARGEST <= value < _LARGEST else "a whole number of more than 64 bits"
    return ""  # dates, and numbers that are not finite: whoever reads on can name what they stand for


def _writable(text: str) -> bool:
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True
