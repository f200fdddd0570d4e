"""Compiled kernels in numba's cache, each in a file of its own, whoever else writes there meanwhile."""

from __future__ import annotations

import hashlib
import multiprocessing
import sys
from typing import Any

from numba.core.caching import IndexDataCacheFile

_PARTS = ("save", "load", "_dump", "_data_name", "_save_data", "_save_index", "_load_index")

_load = getattr(IndexDataCacheFile, "load", None)
_told: list[OSError] = []


def keep_kernels_apart() -> None:
    """From now on, kernels are written into files that are named by what they were compiled for.

    Numba counts them: where two processes compile a kernel for different types at once, both may take one
    number, and the index leads from the types of the one to the code for those of the other, for ever. Files
    that are damaged or cannot be written end a process there; here, what they hold is compiled again. A
    numba that is built otherwise stays as it is.
    """
    if all(hasattr(IndexDataCacheFile, name) for name in _PARTS):
        IndexDataCacheFile.save = _save  # type: ignore[method-assign]
        IndexDataCacheFile.load = _load_whole  # type: ignore[method-assign]


def _save(cache: Any, key: Any, data: Any) -> None:
    """Write a kernel, then that it is there: in between nobody is led to a file that is not whole."""
    digest = hashlib.sha256(cache._dump(key)).digest()
    name = cache._data_name(int.from_bytes(digest[:6]))
    try:
        cache._save_data(name, data)
        cache._save_index({**_index(cache), key: name})
    except OSError as error:  # a full disk: the kernel works all the same
        if not _told and multiprocessing.parent_process() is None:
            text = "layoutexplore: compiled kernels cannot be kept, and are compiled again the next time"
            print(f"{text}: {error}", file=sys.stderr, flush=True)
        _told.append(error)


def _load_whole(cache: Any, key: Any) -> Any:
    """A kernel from its file, None where there is none or a machine that lost power left half of one."""
    try:
        return _load(cache, key) if _load else None
    except Exception:  # whatever unpickling raises
        return None


def _index(cache: Any) -> dict[Any, str]:
    """The files of kernels by what they are for; none where the index is damaged."""
    try:
        found: dict[Any, str] = cache._load_index()
    except OSError:
        raise
    except Exception:
        return {}
    return found
