"""Kernels that two processes compile for different types at once, and files that are not whole."""

from __future__ import annotations

from pathlib import Path

import pytest
from numba.core.caching import IndexDataCacheFile

import layoutexplore.grids  # noqa: F401  (changes how kernels are kept)


def test_the_index_leads_to_the_code_for_its_types(tmp_path: Path) -> None:
    first, second, reader = (IndexDataCacheFile(str(tmp_path), "kernel", "stamp") for _ in range(3))
    write = first._save_data

    def while_another_writes(name: str, data: str) -> None:
        second.save("floats", "code for floats")
        write(name, data)

    first._save_data = while_another_writes
    second._load_index = dict  # it has looked before the first one wrote
    first.save("integers", "code for integers")
    assert reader.load("floats") == "code for floats"
    assert reader.load("integers") in ("code for integers", None)
    first._save_data = write
    first.save("integers", "newer code for integers")
    assert reader.load("integers") == "newer code for integers"


@pytest.mark.parametrize("pattern", ["*.nbi", "*.nbc"])
@pytest.mark.parametrize("left", [0, 10])
def test_what_a_damaged_file_held_is_compiled_again(tmp_path: Path, pattern: str, left: int) -> None:
    """A machine that loses power may leave files that are not whole."""
    cache = IndexDataCacheFile(str(tmp_path), "kernel", "stamp")
    cache.save("integers", "code for integers")
    for file in tmp_path.glob(pattern):
        file.write_bytes(file.read_bytes()[:left])
    assert cache.load("integers") is None
    cache.save("integers", "the same code")
    assert cache.load("integers") == "the same code"


def test_a_kernel_that_cannot_be_kept_works(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cache = IndexDataCacheFile(str(tmp_path / "none"), "kernel", "stamp")
    for _ in range(2):
        cache.save("integers", "code for integers")
    assert capsys.readouterr().err.count("compiled kernels cannot be kept") == 1
