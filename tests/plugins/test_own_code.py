"""Files and modules of a user's own: loaded once, again when they change, never in between."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from layoutexplore.errors import OwnCodeError
from layoutexplore.plugins.own_code import Reference, pinned, pins, reference_in
from tests.plugins.cases import write


def reference(path: str, name: str = "VALUE") -> Reference:
    found = reference_in(f"{path}:{name}")
    assert found is not None
    return found


def test_what_is_a_reference() -> None:
    assert reference_in("a/b.py:C:x=1,y=2") == Reference("a/b.py:C", "a/b.py", "C")
    assert reference_in(r"C:\code\b.py:C") == Reference(r"C:\code\b.py:C", r"C:\code\b.py", "C")
    assert reference_in("json.decoder:JSONDecoder") is not None
    for text in ("nearest:min_size=1", "tour", "office:3", "reconstruct:rose2", "mine.py", "x=a.py:C"):
        assert reference_in(text) is None


def test_a_file_is_loaded_once_and_again_when_it_changes(tmp_path: Path) -> None:
    path = write(tmp_path, "VALUE = object()")
    first, digest = reference(path).load(), reference(path).digest()
    assert reference(path).load() is first
    write(tmp_path, "VALUE = 2")
    assert reference(path).load() == 2 and reference(path).digest() != digest


def test_what_it_imports_from_beside_it_counts(tmp_path: Path) -> None:
    write(tmp_path, "SIZE = 1", "beside_mine.py")
    path = write(tmp_path, "import beside_mine\nVALUE = beside_mine.SIZE")
    digest = reference(path).digest()
    write(tmp_path, "SIZE = 25", "beside_mine.py")
    assert reference(path).digest() != digest and reference(path).load() == 25


def test_a_pinned_file_stays_what_it_was(tmp_path: Path) -> None:
    path = write(tmp_path, "VALUE = 1")
    reference(path).load()
    kept = pins()
    write(tmp_path, "VALUE = 2")
    with pinned(kept):
        assert reference(path).load() == 1
    assert reference(path).load() == 2
    with pinned(kept), pytest.raises(OwnCodeError, match="has changed since the benchmark began"):
        reference(path).load()


def test_a_name_leads_where_it_led_from_another_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(tmp_path, "VALUE = 7", "relative.py")
    monkeypatch.chdir(tmp_path)
    reference("relative.py").load()
    kept = pins()
    monkeypatch.chdir(tmp_path.parent)
    with pinned(kept):
        assert reference("relative.py").load() == 7


def test_the_search_path_keeps_the_working_folder_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(tmp_path, "VALUE = 7", "found_here.py")
    monkeypatch.chdir(tmp_path)
    assert reference("found_here").load() == 7
    assert str(tmp_path) not in sys.path
