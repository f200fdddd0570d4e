"""Tracebacks of a user's own code: without the frames of this package around it."""

from __future__ import annotations

import sysconfig
import traceback
from importlib.util import find_spec
from pathlib import Path

import layoutexplore

_MAPPED = ("envs", "agents", "maps")
_OURS = tuple(
    {str(Path(folder).resolve() / name) for folder in layoutexplore.__path__ for name in _MAPPED}
    | {str(Path(layoutexplore.__file__).resolve().parent)}
)
"""Folders of this package."""

_PYTHON = tuple(
    {str(Path(sysconfig.get_path(name)).resolve()) for name in ("stdlib", "purelib", "platlib")}
    | {str(Path(str(spec.origin)).resolve().parents[1]) for spec in [find_spec("typer")] if spec}
)
"""Folders of Python and of what is installed, the last one wherever that is (`pip install --target`)."""

_LONGEST_LINE, _LONGEST = 300, 2600
"""Characters of a line, and of all, that are told: a line of a program may be as long as a file."""


def told(error: BaseException) -> str:
    """The traceback of an error from the user's first frame on, or only what it says where there is none."""
    frames = own_frames(error)
    parts = ["Traceback (most recent call last):\n", *traceback.format_list(frames)] if frames else []
    lines = "".join([*parts, *traceback.format_exception_only(error)]).rstrip("\n").split("\n")
    text = "\n".join(line if len(line) <= _LONGEST_LINE else f"{line[:_LONGEST_LINE]}..." for line in lines)
    half = _LONGEST // 2
    return text if len(text) <= _LONGEST else f"{text[:half]}\n...\n{text[-half:]}"


def own_frames(error: BaseException) -> list[traceback.FrameSummary]:
    """Frames from the first of a user's own code on, those of this package left out; none without such."""
    frames = list(traceback.extract_tb(error.__traceback__))
    first = next((k for k, frame in enumerate(frames) if _is_own(frame.filename)), len(frames))
    return [frame for frame in frames[first:] if not _within(frame.filename, _OURS)]


def _is_own(file: str) -> bool:
    """Whether a file is neither of this package nor of an installed one."""
    installed = _within(file, _PYTHON) or "site-packages" in file or file.startswith("<frozen")
    return not (installed or _within(file, _OURS))


def _within(file: str, folders: tuple[str, ...]) -> bool:
    return any(Path(folder) in Path(file).resolve().parents for folder in folders)
