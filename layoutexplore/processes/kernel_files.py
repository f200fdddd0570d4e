"""Compiled kernels in numba's cache, each in a file of its own, whoever else writes there meanwhile."""

from __future__ import annotations

import hashlib
from typing import Any

from numba.core.caching import IndexDataCacheFile

_PARTS = ("save", "_dump", "_data_name", "_save_data", "_save_index", "_load_index")


def keep_kernels_apart() -> None:
    """From now on, kernels are written into files that are named by what they were compiled for.

    Numba counts them: where two processes compile a kernel for different types at once, both may take one
    number, and the index leads from the types of the one to the code for those of the other, for ever. A
    numba that is built otherwise stays as it is.
    """
    if all(hasattr(IndexDataCacheFile, name) for name in _PARTS):
        IndexDataCacheFile.save = _save  # type: ignore[method-assign]


def _save(cache: Any, key: Any, data: Any) -> None:
    """Write a kernel, then that it is there: in between nobody is led to a file that is not whole."""
    digest = hashlib.sha256(cache._dump(key)).digest()
    name = cache._data_name(int.from_bytes(digest[:6]))
    cache._save_data(name, data)
    cache._save_index({**cache._load_index(), key: name})
