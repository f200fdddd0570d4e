"""What each thread remembers for itself."""

from __future__ import annotations

import threading
from typing import Any


class ByThread(threading.local):
    """An object that is made anew for each thread that uses it: threads never see what others keep in it.

    Caches that kernels write into are such: explorations in several threads may share a predictor. Copies,
    pickled ones too, have what the thread that makes them has kept. Children are made without arguments.

    Example:
        >>> class Kept(ByThread):
        ...     def __init__(self) -> None:
        ...         self.seen = 0
        >>> kept = Kept()
        >>> kept.seen = 3
        >>> thread = threading.Thread(target=lambda: print(kept.seen))
        >>> thread.start(), thread.join()
        0
        (None, None)
    """

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (), dict(self.__dict__)
