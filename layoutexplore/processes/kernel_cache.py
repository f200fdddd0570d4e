"""Where numba keeps compiled kernels."""

from __future__ import annotations

import contextlib
import os
import sys
import tempfile
from pathlib import Path


def keep_kernels_somewhere(package: Path) -> None:
    """Name a folder for compiled kernels where numba would find none: it could not even be imported then.

    Numba keeps them beside the code or, where that is read-only, in the user's cache; a user without a home
    has neither. To be called before numba is imported; does nothing where `NUMBA_CACHE_DIR` is set.

    Args:
        package: A folder with code.
    """
    if "NUMBA_CACHE_DIR" in os.environ or _is_writable(package):
        return
    with contextlib.suppress(RuntimeError):  # nobody knows this user, as in some containers
        if _is_writable(_user_cache()):
            return
    folder = Path(tempfile.gettempdir()) / f"layoutexplore-kernels-{getattr(os, 'getuid', int)()}"
    with contextlib.suppress(OSError):
        folder.mkdir(mode=0o700)
    if not _is_private(folder):  # kernels are code: nobody else may have put some there
        folder = Path(tempfile.mkdtemp(prefix="layoutexplore-kernels-"))
    os.environ["NUMBA_CACHE_DIR"] = str(folder)


def _user_cache() -> Path:
    """Where numba keeps kernels of code that it cannot write beside."""
    if os.name == "nt":
        return Path(os.environ.get("LOCALAPPDATA", "~")).expanduser()
    if sys.platform == "darwin":
        return Path("~/Library/Caches").expanduser()
    return Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser()


def _is_writable(folder: Path) -> bool:
    """Whether files can be made there; folders that lead there are made."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


def _is_private(folder: Path) -> bool:
    """Whether a folder is this user's and only he can write there."""
    if not _is_writable(folder) or folder.is_symlink():
        return False
    state = folder.stat()
    return not hasattr(os, "getuid") or (state.st_uid == os.getuid() and not state.st_mode & 0o022)
