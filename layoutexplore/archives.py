"""Archives of arrays, read with errors that say what is wrong with them; nothing is unpickled."""

from __future__ import annotations

import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from layoutexplore.errors import ResultsError


def read_arrays(path: Path, *names: str) -> dict[str, NDArray[Any]]:
    """Arrays of an .npz archive by name.

    Args:
        path: The archive.
        names: Those to read; all when none is named.

    Raises:
        ResultsError: It is missing, cannot be read, is cut off or damaged, or lacks an array.
    """
    try:
        with np.load(path, allow_pickle=False) as data:
            return {name: data[name] for name in names or data.files}
    except FileNotFoundError as error:
        raise ResultsError(f"{path} is missing") from error
    except (OSError, EOFError, KeyError, ValueError, zipfile.BadZipFile, zlib.error) as error:
        raise ResultsError(f"{path} is damaged: {error}") from error


def is_whole(path: Path) -> bool:
    """Whether an archive is there and was written to its end: its table of contents comes last."""
    return path.is_file() and zipfile.is_zipfile(path)
