"""Films of explorations: frames are written as they come, so that a long run needs no memory for them."""

from __future__ import annotations

import os
import re
import subprocess
import tempfile
from pathlib import Path
from types import TracebackType

import numpy as np

from layoutexplore.errors import ConfigError, WriteError, checks_making, require, shortened
from layoutexplore.files import put_in_place
from layoutexplore.grids.arrays import Bytes
from layoutexplore.options import Rule, check_kind

SUFFIXES = (".mp4", ".gif")

_KINDS = {
    ".mp4": (
        *("-vcodec", "libx264", "-pix_fmt", "yuv420p", "-crf", "25"),
        *("-vf", "scale=trunc((iw+1)/2)*2:trunc((ih+1)/2)*2"),  # H.264 has no odd sizes.
    ),
    ".gif": (
        *("-vcodec", "gif", "-pix_fmt", "pal8"),
        # Each frame has colours of its own: those of all would be known only when the last one is there.
        "-filter_complex",
        "split[a][b];[a]palettegen=stats_mode=single[p];[b][p]paletteuse=new=1:dither=none",
    ),
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
            raise ConfigError(f"a film is an {' or '.join(SUFFIXES)} file, got {shortened(str(path))}")
        Rule(above=0.0, high=120.0).convert("frames per second", fps)
        self.path = path
        self.fps = fps
        self._program = str(require("imageio_ffmpeg", "bench").get_ffmpeg_exe())
        self._ffmpeg: subprocess.Popen[bytes] | None = None
        self._last: Bytes | None = None

    def __enter__(self) -> Film:
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._folder = tempfile.TemporaryDirectory(dir=self.path.parent, prefix=".film-")
        except OSError as error:
            raise ConfigError(f"{self.path}: a film cannot be written there: {error.strerror}") from error
        self._unfinished = Path(self._folder.name) / f"film{self.path.suffix.lower()}"
        return self

    def add(self, frame: Bytes) -> None:
        """Append a frame, uint8 (height, width, 3) RGB.

        Raises:
            ConfigError: It has another size than the first one.
            WriteError: The film cannot be written; the disk is full, for one.
        """
        if self._last is None:
            self._ffmpeg = self._begin(*frame.shape[:2])
        elif frame.shape != self._last.shape:
            raise ConfigError(f"all frames of a film have one size, {self._last.shape}; got {frame.shape}")
        self._last = np.ascontiguousarray(frame)
        self._send()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if kind is None and self._last is not None:
                for _ in range(round(HOLD_SECONDS * self.fps)):
                    self._send()
                self._finish()
                put_in_place(self._unfinished, self.path)
        except OSError as wrong:
            raise WriteError(f"{self.path}: cannot write: {wrong.strerror or wrong}") from wrong
        finally:
            if self._ffmpeg is not None:
                self._ffmpeg.kill()
                self._ffmpeg.communicate()
            self._folder.cleanup()

    def _begin(self, height: int, width: int) -> subprocess.Popen[bytes]:
        """Start the program that writes the film; Ctrl-C is not for it."""
        raw = f"-f rawvideo -pix_fmt rgb24 -s {width}x{height} -r {self.fps} -i -".split()
        command = (self._program, "-v", "error", "-y", *raw, "-an", *_KINDS[self._unfinished.suffix])
        return subprocess.Popen(
            [*command, str(self._unfinished)],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            start_new_session=True,
        )

    def _send(self) -> None:
        """Write the last frame, once more."""
        assert self._ffmpeg is not None and self._ffmpeg.stdin is not None and self._last is not None
        try:
            self._ffmpeg.stdin.write(self._last.data)
        except OSError as error:
            self._finish()
            raise WriteError(f"{self.path}: cannot write the film: {error.strerror}") from error

    def _finish(self) -> None:
        """Wait until the film is written.

        Raises:
            WriteError: It cannot be.
        """
        assert self._ffmpeg is not None
        _, told = self._ffmpeg.communicate()
        if self._ffmpeg.returncode:
            lines = told.decode(errors="replace").splitlines() or ["ffmpeg does not say why"]
            reason = re.sub(r"^\[.*?\] ", "", lines[-1])
            raise WriteError(f"{self.path}: cannot write the film: {reason}")
