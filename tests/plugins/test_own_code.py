"""Files and modules of a user's own: loaded once, again when they change, never in between."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from layoutexplore.errors import OwnCodeError
from layoutexplore.plugins.own_code import LARGEST_PINNED, Reference, pinned, pins, reference_in
from tests.plugins.cases import write


def reference(path: str, name: str = "VALUE") -> Reference:
    found = reference_in(f"{path}:{name}")
    assert found is not None
    return found


def test_what_is_a_reference() -> None:
    assert reference_in("a/b.py:C:x=1,y=2") == Reference("a/b.py:C", "a/b.py", "C")
    assert reference_in(r"C:\code\b.py:C") == Reference(r"C:\code\b.py:C", r"C:\code\b.py", "C")
    assert reference_in("lr=0.1/b.py:C:x=1") == Reference("lr=0.1/b.py:C", "lr=0.1/b.py", "C")
    assert reference_in("json.decoder:JSONDecoder") is not None
    for text in ("nearest:min_size=1", "tour", "office:3", "reconstruct:rose2", "mine.py", "tour:x=a.py:C"):
        assert reference_in(text) is None


def test_a_file_is_loaded_once_and_again_when_it_changes(tmp_path: Path) -> None:
    path = write(tmp_path, "VALUE = object()")
    first, digest = reference(path).load(), reference(path).digest()
    assert reference(path).load() is first
    write(tmp_path, "VALUE = 2")
    assert reference(path).load() == 2 and reference(path).digest() != digest


def test_annotations_of_a_file_are_what_they_are_in_a_program(tmp_path: Path) -> None:
    """Texts only in a file that asks for them by `from __future__ import annotations`."""
    text = "def run(size: int): ...\nVALUE = run.__annotations__['size']"
    assert reference(write(tmp_path, text)).load() is int
    text = f"from __future__ import annotations\n{text}"
    assert reference(write(tmp_path, text)).load() == "int"


def test_what_it_imports_from_beside_it_counts(tmp_path: Path) -> None:
    write(tmp_path, "SIZE = 1", "beside_mine.py")
    path = write(tmp_path, "import beside_mine\nVALUE = beside_mine.SIZE")
    digest = reference(path).digest()
    write(tmp_path, "SIZE = 25", "beside_mine.py")
    assert reference(path).digest() != digest and reference(path).load() == 25


def test_numbers_of_thousands_of_digits_hide_no_import(tmp_path: Path) -> None:
    write(tmp_path, "SIZE = 1", "beside_mine.py")
    late = "def late():\n    import beside_mine\n    return 0x" + "f" * 5000
    path = write(tmp_path, f"LONG = (0x{'f' * 5000}, 1)\n{late}\nVALUE = 3")
    digest = reference(path).digest()
    write(tmp_path, "SIZE = 2", "beside_mine.py")
    assert reference(path).load() == 3 and reference(path).digest() != digest


def test_files_of_two_folders_have_their_own_modules_of_one_name(tmp_path: Path) -> None:
    for size in (1, 2):
        folder = tmp_path / f"variant{size}"
        (folder / "parts_of_mine").mkdir(parents=True)
        write(folder, f"SIZE = {size}", "size_of_mine.py")
        write(folder / "parts_of_mine", "from size_of_mine import SIZE", "__init__.py")
        write(folder / "parts_of_mine", f"DEPTH = {10 * size}", "depth.py")
        write(folder, "from parts_of_mine import SIZE, depth\nVALUE = SIZE, depth.DEPTH")
    first, second = (reference(str(tmp_path / f"variant{size}" / "mine.py")) for size in (1, 2))
    assert first.load() == (1, 10) and second.load() == (2, 20) and first.load() == (1, 10)
    digests = first.digest(), second.digest()
    write(tmp_path / "variant1", "SIZE = 7", "size_of_mine.py")
    assert first.load() == (7, 10) and second.load() == (2, 20)
    assert first.digest() != digests[0] and second.digest() == digests[1]


def test_what_is_imported_late_is_that_beside_the_file_loaded_last(tmp_path: Path) -> None:
    for size in (1, 2):
        folder = tmp_path / f"late{size}"
        folder.mkdir()
        write(folder, f"SIZE = {size}", "late_size_of_mine.py")
        write(folder, "def VALUE():\n    import late_size_of_mine\n    return late_size_of_mine.SIZE")
    first, second = (reference(str(tmp_path / f"late{size}" / "mine.py")) for size in (1, 2))
    assert [one.load()() for one in (first, second, first, second)] == [1, 2, 1, 2]


def test_installed_packages_stay_where_a_folder_has_their_name(tmp_path: Path) -> None:
    (tmp_path / "one").mkdir()
    (tmp_path / "two" / "numpy").mkdir(parents=True)
    installed = sys.modules["numpy"]
    for name in ("one", "two"):
        path = write(tmp_path / name, "import numpy\nVALUE = numpy.pi")
        assert reference(path).load() > 3.0 and sys.modules["numpy"] is installed


def test_a_pinned_file_stays_what_it_was(tmp_path: Path) -> None:
    path = write(tmp_path, "VALUE = 1")
    reference(path).load()
    kept = pins()
    write(tmp_path, "VALUE = 2")
    with pinned(kept):
        assert reference(path).load() == 1
    assert reference(path).load() == 2
    with pinned(kept):
        assert reference(path).load() == 1
    (tmp_path / "mine.py").unlink()
    with pinned(kept):
        assert reference(path).load() == 1


def test_a_large_pinned_file_is_read_where_it_lies(tmp_path: Path) -> None:
    path = write(tmp_path, f"VALUE = 1  # {'x' * LARGEST_PINNED}")
    reference(path).load()
    kept = pins()
    assert not kept[path].files
    write(tmp_path, "VALUE = 2")
    with pinned(kept):
        assert reference(path).load() == 1
    assert reference(path).load() == 2
    with pinned(kept), pytest.raises(OwnCodeError, match="has changed since the benchmark began"):
        reference(path).load()


BESIDE = {
    "beside_constant.py": "SIGN = 1",
    "beside_lazily.py": "from beside_package.part import WEIGHT\ndef score(): return WEIGHT",
    "beside_package/__init__.py": "",
    "beside_package/part.py": "from . import deep\nfrom .deep import WEIGHT\nimport beside_constant",
    "beside_package/deep.py": "WEIGHT = 1",
}
IMPORTING = """
from beside_constant import SIGN

def VALUE():
    from beside_lazily import score
    return SIGN, score()
"""


@pytest.fixture
def importing(tmp_path: Path) -> Iterator[str]:
    """A file that imports a number, and more of the files beside it within a function."""
    (tmp_path / "beside_package").mkdir()
    for name, text in BESIDE.items():
        write(tmp_path, text, name)
    yield write(tmp_path, IMPORTING)
    sys.path.remove(str(tmp_path))
    for name in [name for name in sys.modules if name.startswith("beside_")]:
        del sys.modules[name]


@pytest.mark.parametrize("name", list(BESIDE))
def test_every_import_counts_wherever_it_stands(importing: str, tmp_path: Path, name: str) -> None:
    digest = reference(importing).digest()
    write(tmp_path, BESIDE[name] + "\n# another", name)
    assert reference(importing).digest() != digest


def test_what_is_imported_later_stays_as_it_was_pinned(importing: str, tmp_path: Path) -> None:
    value, kept = reference(importing).load(), pins()
    write(tmp_path, "SIGN = -1", "beside_constant.py")
    write(tmp_path, "WEIGHT = -1", "beside_package/deep.py")
    (tmp_path / "beside_lazily.py").unlink()
    with pinned(kept):
        assert value() == (1, 1)
        assert reference(importing).load()() == (1, 1)
    write(tmp_path, BESIDE["beside_lazily.py"], "beside_lazily.py")
    assert reference(importing).load()() == (-1, -1)


def test_what_is_no_python_and_what_imports_itself_is_read_all_the_same(tmp_path: Path) -> None:
    write(tmp_path, "def (", "beside_broken.py")
    write(tmp_path, "import mine, beside_broken, layoutexplore.agents, numpy\nimport beside_b", "beside_a.py")
    write(tmp_path, "import beside_a", "beside_b.py")
    path = write(tmp_path, "def VALUE():\n    import beside_a")
    reference(path).load()
    assert {file.name for file in pins()[path].files} == {
        "mine.py",
        "beside_a.py",
        "beside_b.py",
        "beside_broken.py",
    }


def test_a_module_that_is_edited_within_a_second_is_read_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Python tells compiled code from a text of the same length by that second."""
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    path = write(tmp_path, "from beside_edited import SIZE\nVALUE = SIZE")
    for size in (1, 2):
        os.utime(write(tmp_path, f"SIZE = {size}", "beside_edited.py"), (1e9, 1e9))
        assert reference(path).load() == size
    assert list(tmp_path.glob("__pycache__/beside_edited*"))


@pytest.mark.parametrize("name", ["linked_part.py", "linked_package"])
def test_what_is_a_link_out_of_the_folder_counts(tmp_path: Path, name: str) -> None:
    """Also a module within a package, and where the link leads elsewhere later."""
    here, there = tmp_path / "here", tmp_path / "there"
    for folder in (here, there / "one", there / "two"):
        folder.mkdir(parents=True)
    for size, folder in enumerate(("one", "two"), 1):
        write(there / folder, f"SIZE = {size}", "__init__.py" if name == "linked_package" else "part_of.py")
    target = "" if name == "linked_package" else "part_of.py"
    (here / name).symlink_to(there / "one" / target)
    path = write(here, f"from {name.removesuffix('.py')} import SIZE\nVALUE = SIZE")
    digest, kept = reference(path).digest(), pins()
    assert reference(path).load() == 1
    (here / name).unlink()
    (here / name).symlink_to(there / "two" / target)
    assert reference(path).digest() != digest and reference(path).load() == 2
    with pinned(kept):
        assert reference(path).load() == 1 and reference(path).digest() == digest
    (there / "two" / (target or "__init__.py")).write_text("SIZE = 33")
    assert reference(path).load() == 33


def test_a_package_of_one_s_own_counts_as_a_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "own_package").mkdir()
    write(tmp_path, "from own_package.sizes import SIZE\nVALUE = SIZE", "own_package/__init__.py")
    write(tmp_path, "SIZE = 3", "own_package/sizes.py")
    found = Reference("own_package:VALUE", "own_package", "VALUE")
    assert found.load() == 3
    assert {file.name for file in pins()["own_package"].files} == {"__init__.py", "sizes.py"}


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
