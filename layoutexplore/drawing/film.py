"""Films of explorations: frames are written as they come, so that a long run needs no memory for them."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from layoutexplore.errors import ConfigError, checks_making, require
from layoutexplore.files import put_in_place
from layoutexplore.grids.arrays import Bytes
from layoutexplore.options import Rule, check_kind

SUFFIXES = (".mp4", ".gif")

_KINDS: dict[str, dict[str, Any]] = {
    ".mp4": {"codec": "libx264", "macro_block_size": 2},
    ".gif": {
        "codec": "gif",
        "macro_block_size": 1,
        "pix_fmt_out": "pal8",
        "quality": None,
        # Each frame has colours of its own: those of all would be known only when the last one is there.
        "output_params": [
            "-filter_complex",
            "split[a][b];[a]palettegen=stats_mode=single[p];[b][p]paletteuse=new=1:dither=none",
        ],
    },
}
"""How ffmpeg writes each kind of file."""

HOLD_SECONDS = 1.5
"""How long the last frame stays."""


@checks_making
class Film:
    """A film that is being written, used as a context manager; the file appears when the block ends well.

    Args:
        path: Where to: .mp4 (H.264) or .gif.
        fps: Frames per second.

    Raises:
        ConfigError: Another kind of file, a frame rate that makes no sense, or a place that cannot be
            written.
        MissingExtraError: imageio-ffmpeg is not installed.
    """

    def __init__(self, path: str | os.PathLike[str], *, fps: float = 12.0) -> None:
        check_kind("path", path, str, os.PathLike)
        path = Path(path)
        if path.suffix.lower() not in SUFFIXES:
            raise ConfigError(f"a film is an {' or '.join(SUFFIXES)} file, got {path.name!r}")
        Rule(above=0.0, high=120.0).convert("frames per second", fps)
        self.path = path
        self.fps = fps
        self._ffmpeg: Any = require("imageio_ffmpeg", "bench")
        self._writer: Any = None
        self._last: Bytes | None = None

    def __enter__(self) -> Film:
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._folder = tempfile.TemporaryDirectory(dir=self.path.parent, prefix=".film-")
        except OSError as error:
            raise ConfigError(f"{self.path}: a film cannot be written there: {error.strerror}") from error
        self._unfinished = Path(self._folder.name) / self.path.name
        return self

    def add(self, frame: Bytes) -> None:
        """Append a frame, uint8 (height, width, 3) RGB.

        Raises:
            ConfigError: It has another size than the first one.
        """
        if self._last is None:
            height, width = frame.shape[:2]
            kind = _KINDS[self.path.suffix.lower()]
            self._writer = self._ffmpeg.write_frames(
                str(self._unfinished), (width, height), fps=self.fps, **kind
            )
            self._writer.send(None)
        elif frame.shape != self._last.shape:
            raise ConfigError(f"all frames of a film have one size, {self._last.shape}; got {frame.shape}")
        self._last = np.ascontiguousarray(frame)
        self._writer.send(self._last)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._last is not None:
            for _ in range(round(HOLD_SECONDS * self.fps) if kind is None else 0):
                self._writer.send(self._last)
            self._writer.close()
        if kind is None and self._last is not None:
            put_in_place(self._unfinished, self.path)
        self._folder.cleanup()
