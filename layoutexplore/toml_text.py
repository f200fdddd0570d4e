"""Writing TOML, which the standard library only reads."""

from __future__ import annotations

import json
import re
from typing import Any


def to_toml(table: dict[str, Any]) -> str:
    """Nested tables of strings, numbers, booleans and lists as TOML; keys with the value None are left out.

    Example:
        >>> print(to_toml({"a": [1, "x"], "t": {"b": None, "c": True}}))
        a = [1, "x"]
        <BLANKLINE>
        [t]
        c = true
        <BLANKLINE>
    """
    lines: list[str] = []
    _write_table(table, [], lines)
    return "\n".join(lines).lstrip("\n") + "\n"


def _write_table(table: dict[str, Any], path: list[str], lines: list[str]) -> None:
    plain = {k: v for k, v in table.items() if not isinstance(v, dict) and v is not None}
    if path and plain:
        lines.append(f"\n[{'.'.join(map(_key, path))}]")
    lines.extend(f"{_key(k)} = {json.dumps(v, ensure_ascii=False)}" for k, v in plain.items())
    for key, value in table.items():
        if isinstance(value, dict):
            _write_table(value, [*path, key], lines)


def _key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else json.dumps(name, ensure_ascii=False)
