"""The random numbers of this process that belong to nobody: a user's own code may draw them."""

from __future__ import annotations

import random
import sys
from collections.abc import Callable
from typing import Any

import numpy as np


def random_numbers_now() -> Callable[[], None]:
    """What brings back the random numbers of Python, NumPy and torch, if it is loaded, as they are now.

    Example:
        >>> again = random_numbers_now()
        >>> first = random.random(), np.random.random()
        >>> again()
        >>> (random.random(), np.random.random()) == first
        True
    """
    ours, numbers = random.getstate(), np.random.get_state()  # noqa: NPY002
    torch: Any = sys.modules.get("torch")
    states = torch.get_rng_state() if torch else None
    devices = torch.cuda.get_rng_state_all() if torch and torch.cuda.is_initialized() else None

    def restore() -> None:
        random.setstate(ours)
        np.random.set_state(numbers)  # noqa: NPY002
        if torch:
            torch.set_rng_state(states)
        if devices is not None:
            torch.cuda.set_rng_state_all(devices)

    return restore
