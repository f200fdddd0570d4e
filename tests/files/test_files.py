"""Files: whole or not at all, tables, numbers, archives."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from layoutexplore.errors import ConfigError, MapError, ResultsError, WriteError, checks_arguments
from layoutexplore.files import (
    all_or_none,
    atomic,
    is_whole,
    read_arrays,
    read_bytes,
    read_csv,
    read_json,
    read_toml,
    read_yaml,
    reading,
    to_toml,
    write_arrays,
    write_atomically,
    write_csv,
    write_json,
)
from layoutexplore.files.locking import held
from layoutexplore.files.reading import is_file


def test_a_file_is_whole_or_as_it_was(tmp_path: Path) -> None:
    path = tmp_path / "new" / "a.txt"
    write_atomically(path, "one\n")
    with pytest.raises(RuntimeError), atomic(path) as temporary:
        temporary.write_text("half")
        raise RuntimeError
    assert path.read_bytes() == b"one\n" and [p.name for p in path.parent.iterdir()] == ["a.txt"]


_KILLED = """
import os, signal, sys
from pathlib import Path
from layoutexplore.files import all_or_none, atomic

folder = Path(sys.argv[1])
with atomic(folder / "map.png") as half, all_or_none(folder) as together:
    half.write_bytes(b"half")
    (together / "trees").write_text("half")
    os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="no process is killed by a signal there")
def test_the_next_who_holds_a_folder_removes_what_was_left_half_written(tmp_path: Path) -> None:
    subprocess.run([sys.executable, "-c", _KILLED, str(tmp_path)], check=False, timeout=60)
    others = [tmp_path / name for name in (".notes.part", ".download.part", "map.png.part")]
    for other in others:
        other.mkdir()
    assert len(list(tmp_path.iterdir())) == 5
    with held(tmp_path, "run"):
        pass
    assert sorted(tmp_path.iterdir()) == sorted(others)


def test_files_that_belong_together_are_replaced_together(tmp_path: Path) -> None:
    folder = tmp_path / "new" / "models"

    def write(text: str, *, stopped: bool) -> None:
        with all_or_none(folder) as beside:
            write_atomically(beside / "trees", text)
            if stopped:
                raise KeyboardInterrupt
            write_atomically(beside / "networks", text)

    with pytest.raises(KeyboardInterrupt):
        write("1", stopped=True)
    assert not folder.exists()
    write("1", stopped=False)
    (folder / "other").write_text("mine")
    with pytest.raises(KeyboardInterrupt):
        write("2", stopped=True)
    kept = {path.name: path.read_text() for path in folder.iterdir()}
    assert kept == {"trees": "1", "networks": "1", "other": "mine"}
    write("2", stopped=False)
    assert {path.name: path.read_text() for path in folder.iterdir()} == dict.fromkeys(kept, "2") | {
        "other": "mine"
    }
    with pytest.raises(WriteError, match=f"^{folder / 'other'}: cannot write"), all_or_none(folder / "other"):
        pass
    with pytest.raises(WriteError, match=f"^{folder / 'trees'}: cannot write"), all_or_none(folder) as beside:
        (beside / "trees").mkdir()
        write_atomically(beside / "trees", "3")


def test_what_cannot_be_written_is_an_error_of_maps_and_of_results(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    for kind in (WriteError, MapError, ResultsError):
        with pytest.raises(kind, match=r"a\.txt: cannot write"):
            write_atomically(tmp_path / "file" / "a.txt", b"")


def test_tables(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    write_csv(path, [{"a": 1, "b": 1 / 3}, {"a": "x,y", "b": None}])
    assert path.read_bytes() == b'a,b\n1,0.333333\n"x,y",\n'
    write_csv(path, [{"a": 100.0}], digits=None)
    assert path.read_bytes() == b"a\n100.0\n"
    write_csv(path, [], columns=["a", "b"])
    assert path.read_bytes() == b"a,b\n"
    write_csv(path, [])
    assert path.read_bytes() == b""


def test_json_files_hold_no_word_that_json_does_not_know(tmp_path: Path) -> None:
    path = tmp_path / "n.json"
    write_json(path, {"a": math.nan, "b": [1.5, math.inf], "c": {"d": (1, -math.inf)}, "e": "NaN"})
    data = json.loads(path.read_text(), parse_constant=lambda word: pytest.fail(word))
    assert data == {"a": None, "b": [1.5, None], "c": {"d": [1, None]}, "e": "NaN"}


def test_toml_is_read_as_it_was_written(tmp_path: Path) -> None:
    table = {"a": 1, "b": ["x", "ü\"'"], "c": {"d.e": True, "f": {"g": 0.5}}, "none": None}
    write_atomically(tmp_path / "t.toml", to_toml(table))
    del table["none"]
    assert read_toml(tmp_path / "t.toml") == table
    with pytest.raises(ConfigError, match="cannot read the configuration"):
        read_toml(tmp_path / "none.toml")
    write_atomically(tmp_path / "t.toml", b"a = \xff")
    with pytest.raises(ConfigError, match="no text in UTF-8"):
        read_toml(tmp_path / "t.toml")


def test_archives(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    write_arrays(path, {"x": np.arange(3), "y": np.ones((2, 2), np.float32)})
    assert is_whole(path) and list(read_arrays(path)) == ["x", "y"] and list(read_arrays(path, "y")) == ["y"]
    path.write_bytes(path.read_bytes()[:100])
    assert not is_whole(path)
    with pytest.raises(ResultsError, match="damaged"):
        read_arrays(path)


@checks_arguments
def joined(*parts: str, **numbers: int) -> str:
    return "".join(parts) + str(1 // sum(numbers.values()))


def test_of_several_arguments_each_is_looked_at() -> None:
    """As of the names of arrays; all together were taken for one: "parts must be str, got ('a', 'b')"."""
    with pytest.raises(ZeroDivisionError):
        joined("a", "b", one=0)
    with pytest.raises(ConfigError, match=r"joined: parts\[1\] must be str, got 2$"):
        joined("a", 2, one=1)  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match=r"joined: two must be int, got 'x'$"):
        joined("a", one=1, two="x")  # type: ignore[arg-type]


def test_every_text_and_number_is_valid_toml(tmp_path: Path) -> None:
    table = {"a\x7f": "b\x7f\x00\u2028", "list": [math.inf, -math.inf, 1e300], "nested": {"x": 1.0}}
    write_atomically(tmp_path / "t.toml", to_toml({**table, "nan": math.nan}))
    read = read_toml(tmp_path / "t.toml")
    assert math.isnan(read.pop("nan")) and read == table


def test_names_of_files_that_are_no_text_are_valid_toml(tmp_path: Path) -> None:
    """As a path with an umlaut is in a process without UTF-8."""
    name = b"r\xe4um".decode(errors="surrogateescape")
    write_atomically(tmp_path / "t.toml", to_toml({"commands": [f"benchmark {name}"], "plans": {name: name}}))
    assert read_toml(tmp_path / "t.toml") == {
        "commands": ["benchmark r\\udce4um"],
        "plans": {"r\\udce4um": "r\\udce4um"},
    }


class Shy:
    """An object that is no plain value and cannot show itself."""

    def __repr__(self) -> str:
        raise RuntimeError


def test_what_is_no_plain_value_is_not_written(tmp_path: Path) -> None:
    endless: dict[str, Any] = {}
    endless["self"] = endless
    for value in ({"a": Shy()}, {"a": 1j}, endless):
        with pytest.raises(WriteError, match="plain value"):
            write_json(tmp_path / "a.json", value)
        with pytest.raises(ConfigError, match="plain value"):
            to_toml(value)
    assert not list(tmp_path.iterdir())


def test_a_name_that_is_no_text_is_written_as_python_shows_it(tmp_path: Path) -> None:
    write_atomically(tmp_path / "a.txt", "made by \udcff")
    assert (tmp_path / "a.txt").read_text() == "made by \\udcff"


def test_a_file_is_named_by_a_path_and_its_limit_by_a_known_name(tmp_path: Path) -> None:
    for path in (None, "a.txt", Shy()):
        with pytest.raises(WriteError, match="named by a Path"), atomic(path):  # type: ignore[arg-type]
            pass
    with pytest.raises(ConfigError, match="did you mean 'text_mb'"):
        read_bytes(tmp_path / "a.txt", MapError, limit="txt_mb")
    assert not is_file(tmp_path / ("x" * 300)) and not is_file(tmp_path)


def test_the_mark_that_windows_begins_texts_with_is_no_part_of_them(tmp_path: Path) -> None:
    for name, text in (("a.json", '{"a": 1}'), ("a.toml", "a = 1"), ("a.yaml", "a: 1"), ("a.csv", "a,b")):
        (tmp_path / name).write_text(text, encoding="utf-8-sig")
    assert read_json(tmp_path / "a.json") == {"a": 1}
    assert read_toml(tmp_path / "a.toml") == {"a": 1}
    assert read_yaml(tmp_path / "a.yaml") == {"a": 1}
    assert read_csv(tmp_path / "a.csv") == [["a", "b"]]


def test_the_fingerprint_of_the_package_is_of_all_its_folders(monkeypatch: pytest.MonkeyPatch) -> None:
    """In a checkout, too, where some lie beside it."""
    seen: list[Path] = []
    monkeypatch.setattr(reading, "fingerprint", lambda files: seen.extend(files))
    reading.package_fingerprint.__wrapped__()
    names = {"/".join(path.parts[-2:]) for path in seen}
    assert {"maps/library.py", "agents/tour.py", "envs/base.py", "layoutexplore/errors.py"} <= names
    assert {"processes/kernels.json", "weights/layout.safetensors"} <= names
