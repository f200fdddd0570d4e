"""Files that are written and read again."""

from __future__ import annotations

from layoutexplore.files import to_toml


def test_toml_is_read_back() -> None:
    import tomllib

    table = {"a": 1, "b": ["x", "ü\"'"], "c": {"d.e": True, "f": {"g": 0.5, "h": None}}, "i": {}}
    assert tomllib.loads(to_toml(table)) == {"a": 1, "b": ["x", "ü\"'"], "c": {"d.e": True, "f": {"g": 0.5}}}
