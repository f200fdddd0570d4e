"""Images: the size that the header declares is compared with the limit before anything is decoded."""

from __future__ import annotations

import os
import re
import struct
import tempfile
import warnings
import zlib
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from layoutexplore.errors import MapError, MapWarning, shortened
from layoutexplore.files.limits import limits, raise_it
from layoutexplore.files.reading import Kind, read_bytes
from layoutexplore.processes import runs_alone

_GAP = rb"(?:\s|#[^\n\r]*[\n\r])++"
_PNM = re.compile(rb"P[1-6]" + _GAP + rb"(\d+)" + _GAP + rb"(\d+)")
_PNM_WHITE = re.compile(rb"P([2356])" + _GAP + rb"\d+" + _GAP + rb"\d+" + _GAP + rb"(\d{1,5})\s")
"""Headers of the PNM family; kind, and level of white of those that declare one."""

_PNG = b"\x89PNG\r\n\x1a\n"

_PIXEL_PARTS = frozenset([b"IHDR", b"PLTE", b"tRNS", b"IDAT", b"IEND"])
"""Chunks of a PNG that say what its pixels are; the others tell of colour profiles, times and the like."""

_FRAMES = frozenset({*range(0xC0, 0xD0)} - {0xC4, 0xC8, 0xCC})
"""Markers of a JPEG file behind which its size stands."""


_MOST_SAID = 300
"""Bytes that are kept of what a decoder says."""

Levels = NDArray[np.uint8] | NDArray[np.uint16]


def read_pixels(path: Path) -> NDArray[np.uint8]:
    """The pixels uint8 (h, w) or (h, w, channels) of an image file; of 16 bits the upper eight.

    White is 255, also where a file of the PNM family declares another level for it.

    Raises:
        LayoutExploreError: As `read_levels` does.
    """
    pixels, white = _read(path, MapError)
    if white is not None:
        return np.rint(np.minimum(pixels, white) * (255.0 / white)).astype(np.uint8)
    return (pixels // 257 if pixels.dtype == np.uint16 else pixels).astype(np.uint8, copy=False)


def read_levels(path: Path, *, error: Kind = MapError) -> Levels:
    """The pixels uint8 or uint16 (h, w) or (h, w, channels) of an image file as they are stored.

    PNG, JPEG, BMP, TIFF and the PNM family are read, whatever the file's ending. A photo that notes how the
    camera was held (JPEG) is turned as viewers show it.

    Raises:
        LayoutExploreError: Of the kind `error`: it cannot be read, is none of these or damaged, has more
            pixels than the limit, or pixels of neither 8 nor 16 bits.

    Warns:
        MapWarning: A photo is read although it is damaged.
    """
    return _read(path, error)[0]


def _read(path: Path, error: Kind) -> tuple[Levels, int | None]:
    """The pixels as they are stored, and the level of white that `_white` finds."""
    data = read_bytes(path, error, "image")
    size = declared_size(data)
    if size is None:
        raise error(
            f"{path}: not an image, or a damaged one: PNG, JPEG, BMP, TIFF and PNM (.pgm) are read; save "
            "what is of another kind as PNG"
        )
    width, height = size
    if width * height > limits().image_pixels:
        raise error(
            f"{path}: {width} x {height} pixels, and the limit image_pixels is {limits().image_pixels:g}: "
            f"make it smaller, or {raise_it('image_pixels', width * height)}"
        )
    pixels, said = _decoded(_pixels_alone(data) if data.startswith(_PNG) else data)
    if pixels is None or not pixels.size:
        raise error(f"{path}: not an image, or a damaged one{f' ({said})' if said else ''}")
    if said:
        warnings.warn(f"{path}: {said}", MapWarning, stacklevel=3)
    if pixels.dtype not in (np.uint8, np.uint16):
        raise error(f"{path}: images of {pixels.dtype} pixels are not supported; use 8 or 16 bits")
    return pixels, _white(data)


def _white(data: bytes) -> int | None:
    """The level of white that a PNM file declares; None where OpenCV heeds it or it is the usual one."""
    match = _PNM_WHITE.match(data[:4096])
    white = int(match[2]) if match else 0
    is_heeded = match is not None and match[1] in b"23" and white < 256  # of texts with levels of 8 bits
    return None if white in (0, 255, 65535) or is_heeded else white


def _pixels_alone(data: bytes) -> bytes:
    """A PNG without what its pixels do not need; empty where a part that they need is damaged.

    libpng prints on stderr what it finds, before OpenCV says that it failed: of damaged parts, and of colour
    profiles that are a little wrong in pictures without a fault. Stderr is the whole process's: what other
    threads and the processes that they start write there would be lost if it led elsewhere meanwhile. So
    libpng is given what it has nothing to say of; see `_overheard` for other kinds, which have no checksums.
    """
    kept, place, kind = [data[:8]], 8, b""
    while kind != b"IEND" and place + 12 <= len(data):
        size, kind = struct.unpack_from(">I4s", data, place)
        end = place + 12 + size
        if kind in _PIXEL_PARTS:
            kept.append(data[place:end])
            if zlib.crc32(data[place + 4 : end - 4]) != int.from_bytes(data[end - 4 : end], "big"):
                return b""
        elif kind[:1].isupper():  # needed by its own word, and unknown
            return b""
        place = end
    return b"".join(kept) if kind == b"IEND" else b""


def _decoded(data: bytes) -> tuple[Any, str]:
    """The pixels, None where there are none to be had, and what the decoder says of the file."""
    import cv2

    as_stored, as_shown = cv2.IMREAD_UNCHANGED, cv2.IMREAD_ANYCOLOR | cv2.IMREAD_ANYDEPTH
    is_photo = data.startswith(b"\xff\xd8")
    if data.startswith((b"P1", b"P2", b"P3")):
        data += b"\n"  # OpenCV does not read the last number of a text that ends with it
    pixels = None
    with _silent_opencv(), _overheard() as said, suppress(Exception):  # OpenCV's own, and that of memory
        pixels = cv2.imdecode(np.frombuffer(data, np.uint8), as_shown if is_photo else as_stored)
    return pixels, "; ".join(said)


@contextmanager
def _overheard() -> Iterator[list[str]]:
    """What a library prints on stderr meanwhile; it is not seen there.

    Stderr is the whole process's, so this is left alone where other threads run: what they, or processes that
    they start, write there could be lost. A library's words are seen then as they are.
    """
    said: list[str] = []
    kept = -1
    with ExitStack() as opened:
        if runs_alone():
            with suppress(OSError):  # no stderr, or nowhere to write
                file = opened.enter_context(tempfile.TemporaryFile())
                kept = os.dup(2)
        if kept < 0:
            yield said
            return
        opened.callback(os.close, kept)
        os.dup2(file.fileno(), 2)
        try:
            yield said
        finally:
            os.dup2(kept, 2)
            file.seek(0)
            lines = file.read(_MOST_SAID).decode(errors="replace").splitlines()
            said += [line if line.isprintable() else shortened(line) for line in dict.fromkeys(lines) if line]


@contextmanager
def _silent_opencv() -> Iterator[None]:
    """A damaged image is our error to report, not OpenCV's; its switch has moved between versions."""
    import cv2

    home = getattr(getattr(cv2, "utils", None), "logging", cv2)
    switch = getattr(home, "setLogLevel", None)
    if switch is None:
        yield
        return
    level = switch(0)
    try:
        yield
    finally:
        switch(level)


def declared_size(data: bytes) -> tuple[int, int] | None:
    """Width and height that an image's header declares; None where it is of no kind that is read.

    Example:
        >>> declared_size(b"P5 3 2 255 ......"), declared_size(b"GIF89a")
        ((3, 2), None)
    """
    for start, read in _HEADERS.items():
        if data.startswith(start):
            try:
                width, height = read(data)
            except (struct.error, IndexError, KeyError, ValueError, TypeError):
                return None
            return (width, height) if width > 0 and height > 0 else None
    return None


def _png(data: bytes) -> tuple[int, int]:
    width, height = struct.unpack_from(">II", data, 16)
    if data[12:16] != b"IHDR":
        raise ValueError
    # A decoder asks for the memory that a chunk declares, up to 4 GB, before it looks whether that is there.
    place = 8
    while place + 12 <= len(data):
        size, kind = struct.unpack_from(">I4s", data, place)
        place += 12 + size
        if place > len(data):
            raise ValueError
        if kind == b"IEND":
            break
    return width, height


def _pnm(data: bytes) -> tuple[int, int]:
    match = _PNM.match(data[:4096])
    if not match or max(map(len, match.groups())) > 9:
        raise ValueError
    return int(match[1]), int(match[2])


def _bmp(data: bytes) -> tuple[int, int]:
    if struct.unpack_from("<I", data, 14)[0] == 12:
        width, height = struct.unpack_from("<HH", data, 18)
    else:
        width, height = struct.unpack_from("<ii", data, 18)
    return width, abs(height)


def _jpeg(data: bytes) -> tuple[int, int]:
    place = 2
    while True:
        if data[place] != 0xFF:
            raise ValueError
        marker = data[place + 1]
        if marker == 0xFF:
            place += 1
        elif marker in _FRAMES:
            height, width = struct.unpack_from(">HH", data, place + 5)
            return width, height
        elif marker == 0x01 or 0xD0 <= marker <= 0xD7:
            place += 2
        else:
            place += 2 + max(struct.unpack_from(">H", data, place + 2)[0], 2)


def _tiff(data: bytes) -> tuple[int, int]:
    order = "<" if data[:2] == b"II" else ">"
    (place,) = struct.unpack_from(f"{order}I", data, 4)
    (count,) = struct.unpack_from(f"{order}H", data, place)
    found = {}
    for k in range(count):
        tag, kind, _ = struct.unpack_from(f"{order}HHI", data, place + 2 + 12 * k)
        if tag in (256, 257):
            form = {3: "H", 4: "I"}[kind]
            (found[tag],) = struct.unpack_from(f"{order}{form}", data, place + 10 + 12 * k)
    return found[256], found[257]


_HEADERS: dict[bytes, Callable[[bytes], tuple[int, int]]] = {
    _PNG: _png,
    b"\xff\xd8": _jpeg,
    b"BM": _bmp,
    b"II*\0": _tiff,
    b"MM\0*": _tiff,
    **{b"P%d" % k: _pnm for k in range(1, 7)},
}
"""Readers of headers by what a file begins with."""
