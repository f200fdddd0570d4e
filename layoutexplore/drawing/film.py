"""Films of explorations: frames are written as they come, so that a long run needs no memory for them."""

from __future__ import annotations

import tempfile
from pathlib import Path
from types import TracebackType
from typing import Any

from layoutexplore.errors import ConfigError, checks_making, require
from layoutexplore.files import put_in_place
from layoutexplore.grids.arrays import Bytes
from layoutexplore.options import Rule, check_kind

SUFFIXES = (".mp4", ".gif")

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
        MissingExtraError: imageio is not installed.
    """

    def __init__(self, path: Path, *, fps: float = 12.0) -> None:
        check_kind("path", path, Path)
        if path.suffix.lower() not in SUFFIXES:
            raise ConfigError(f"a film is an {' or '.join(SUFFIXES)} file, got {path.name!r}")
        Rule(above=0.0, high=120.0).convert("frames per second", fps)
        self.path = path
        self.fps = fps
        self._imageio: Any = require("imageio.v2", "bench")
        self._writer: Any = None
        self._last: Bytes | None = None

    def __enter__(self) -> Film:
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._folder = tempfile.TemporaryDirectory(dir=self.path.parent, prefix=".film-")
        except OSError as error:
            raise ConfigError(f"{self.path}: a film cannot be written there: {error.strerror}") from error
        self._unfinished = Path(self._folder.name) / self.path.name
        gif = self.path.suffix.lower() == ".gif"
        options: dict[str, Any] = (
            {"duration": 1000 / self.fps, "loop": 0} if gif else {"fps": self.fps, "macro_block_size": 2}
        )
        self._writer = self._imageio.get_writer(self._unfinished, **options)
        return self

    def add(self, frame: Bytes) -> None:
        """Append a frame, uint8 (height, width, 3) RGB; all frames have the same size."""
        self._writer.append_data(frame)
        self._last = frame

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None and self._last is not None:
            for _ in range(round(HOLD_SECONDS * self.fps)):
                self._writer.append_data(self._last)
        self._writer.close()
        if kind is None and self._last is not None:
            put_in_place(self._unfinished, self.path)
        self._folder.cleanup()
