"""Two processes that compile a kernel for different types at once."""

from __future__ import annotations

from pathlib import Path

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
