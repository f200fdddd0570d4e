"""Images: levels, and the way up."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest

from layoutexplore.errors import MapError, MapWarning
from layoutexplore.files.images import declared_size, read_levels, read_pixels

MARK = np.zeros((20, 30), np.uint8)
MARK[2:6, 3:12] = 255
"""A picture that looks different from every side."""


@pytest.mark.parametrize("white", [1, 15, 100, 254, 255, 256, 1000, 65535])
@pytest.mark.parametrize("kind", [2, 3, 5, 6])
def test_white_is_white_whatever_level_a_pnm_file_declares_for_it(
    tmp_path: Path, kind: int, white: int
) -> None:
    levels = np.repeat([0, white // 2, white], 3 if kind in (3, 6) else 1)
    text = " ".join(map(str, levels)).encode() + b"\n"
    data = text if kind < 4 else levels.astype(">u2" if white > 255 else "u1").tobytes()
    path = tmp_path / "map.pgm"
    path.write_bytes(b"P%d\n# CREATOR: map_saver\n3 1\n%d\n" % (kind, white) + data)
    found = read_pixels(path).reshape(3, -1)[:, 0]
    assert found[0] == 0 and found[2] == 255
    assert abs(int(found[1]) - 255 * (white // 2) / white) <= 1


def with_orientation(jpeg: bytes, orientation: int) -> bytes:
    """A JPEG with the note (EXIF) how the camera was held."""
    entry = b"\x01\x12\x00\x03\x00\x00\x00\x01" + orientation.to_bytes(2, "big") + b"\x00\x00"
    exif = b"Exif\x00\x00MM\x00*\x00\x00\x00\x08\x00\x01" + entry + b"\x00\x00\x00\x00"
    return jpeg[:2] + b"\xff\xe1" + (len(exif) + 2).to_bytes(2, "big") + exif + jpeg[2:]


@pytest.mark.parametrize(("orientation", "turns"), [(1, 0), (3, 2), (6, -1), (8, 1)])
def test_a_photo_is_turned_as_viewers_show_it(tmp_path: Path, orientation: int, turns: int) -> None:
    _, jpeg = cv2.imencode(".jpg", MARK, [cv2.IMWRITE_JPEG_QUALITY, 100])
    path = tmp_path / "photo.jpg"
    path.write_bytes(with_orientation(jpeg.tobytes(), orientation))
    for found in (read_pixels(path), read_levels(path)):
        np.testing.assert_array_equal(found > 127, np.rot90(MARK, turns) > 127)


@pytest.mark.parametrize(("rows", "cols"), [(4000, 4000), (4032, 3024)])
def test_maps_of_gmapping_as_it_comes_and_photos_of_phones_are_read(
    tmp_path: Path, rows: int, cols: int
) -> None:
    path = tmp_path / "large.pgm"
    cv2.imwrite(str(path), np.full((rows, cols), 205, np.uint8))
    assert read_pixels(path).shape == (rows, cols)


def test_headers_of_blanks_and_remarks_take_no_time() -> None:
    assert declared_size(b"P5" + b" " * 4000 + b"x") is None
    assert declared_size(b"P5" + b"#\n" * 1000 + b"x") is None
    assert declared_size(b"P5 # a\n # b\r\n\t3 # c\n2 255 ") == (3, 2)


@pytest.mark.parametrize("end", [b"", b"\n"])
def test_a_text_of_grey_levels_may_end_with_its_last_number(tmp_path: Path, end: bytes) -> None:
    (tmp_path / "map.pgm").write_bytes(b"P2\n3 1\n255\n0 205 254" + end)
    assert read_pixels(tmp_path / "map.pgm").tolist() == [[0, 205, 254]]


@pytest.mark.parametrize("kind", [b"IDAT", b"PLTE", b"tEXt"])
def test_no_memory_is_asked_for_chunks_that_are_longer_than_their_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: bytes
) -> None:
    data = cv2.imencode(".png", MARK)[1].tobytes()
    place = data.index(b"IDAT") - 4
    path = tmp_path / "map.png"
    for size in (2**32 - 1, 2**31 - 1, len(data)):
        path.write_bytes(data[:place] + size.to_bytes(4, "big") + kind + data[place + 8 :])
        monkeypatch.setattr(cv2, "imdecode", lambda *_: pytest.fail("is decoded"))
        with pytest.raises(MapError, match=r"map\.png: not an image, or a damaged one"):
            read_pixels(path)
    monkeypatch.undo()
    path.write_bytes(data + b"what follows the end of an image")
    np.testing.assert_array_equal(read_pixels(path), MARK)


def chunk(kind: bytes, data: bytes) -> bytes:
    """A part of a PNG."""
    checksum = zlib.crc32(kind + data)
    return len(data).to_bytes(4, "big") + kind + data + checksum.to_bytes(4, "big")


def test_a_damaged_png_is_told_once(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """libpng says nothing of its own on stderr."""
    data = bytearray(cv2.imencode(".png", np.zeros((40, 50), np.uint8))[1].tobytes())
    for place in (data.index(b"IHDR") + 9, data.index(b"IDAT") + 8, len(data) - 6):
        broken = data[:]
        broken[place] ^= 0xFF
        (tmp_path / "map.png").write_bytes(broken)
        with pytest.raises(MapError, match="damaged"):
            read_levels(tmp_path / "map.png")
    (tmp_path / "map.png").write_bytes(data[:33] + chunk(b"ABCD", b"?") + data[33:])
    with pytest.raises(MapError, match="damaged"):
        read_levels(tmp_path / "map.png")
    assert capfd.readouterr().err == ""


def test_what_a_png_tells_besides_its_pixels_says_nothing(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """Programs for pictures write colour profiles that libpng finds wrong, in pictures without a fault."""
    pixels = np.random.default_rng(0).integers(0, 256, (40, 50, 4), np.uint8)
    data = cv2.imencode(".png", pixels)[1].tobytes()
    profile = chunk(b"iCCP", b"sRGB\0\0" + zlib.compress(bytes(200)))
    (tmp_path / "map.png").write_bytes(data[:33] + profile + data[33:])
    assert np.array_equal(read_levels(tmp_path / "map.png"), pixels)
    assert capfd.readouterr().err == ""


def photo() -> bytes:
    """A JPEG with a piece that is none of it."""
    pixels = np.random.default_rng(0).integers(0, 256, (200, 200), np.uint8)
    data = bytearray(cv2.imencode(".jpg", pixels)[1].tobytes())
    data[5000:5200] = bytes(200)
    return bytes(data)


def test_what_a_decoder_says_of_a_file_is_told_with_its_name(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "photo.jpg").write_bytes(photo())
    with pytest.warns(MapWarning, match=r"photo\.jpg: Corrupt JPEG data"):
        assert read_levels(tmp_path / "photo.jpg").shape == (200, 200)
    data = cv2.imencode(".png", np.zeros((40, 50), np.uint8))[1].tobytes()
    short = chunk(b"IDAT", zlib.compress(bytes(100))) + chunk(b"IEND", b"")
    (tmp_path / "map.png").write_bytes(data[:33] + short)  # all checksums are right
    with pytest.raises(MapError, match=r"map\.png: not an image, or a damaged one \(libpng error: "):
        read_levels(tmp_path / "map.png")
    assert capfd.readouterr().err == ""
    os.write(2, b"stderr leads where it led")
    assert capfd.readouterr().err == "stderr leads where it led"


def test_where_other_threads_run_stderr_is_left_to_them(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "photo.jpg").write_bytes(photo())
    ended = threading.Event()
    thread = threading.Thread(target=ended.wait)
    thread.start()
    try:
        assert read_levels(tmp_path / "photo.jpg").shape == (200, 200)
    finally:
        ended.set()
        thread.join()
    assert "Corrupt JPEG data" in capfd.readouterr().err


def test_a_command_has_no_other_threads(tmp_path: Path) -> None:
    """But for one that waits for Ctrl-C, which prints nothing."""
    (tmp_path / "photo.jpg").write_bytes(photo())
    words = [sys.executable, "-m", "layoutexplore", "maps", "show", str(tmp_path / "photo.jpg")]
    said = subprocess.run(words, capture_output=True, text=True, check=False).stderr.splitlines()
    assert any("photo.jpg: Corrupt JPEG data" in line for line in said)
    assert all(line.startswith("layoutexplore: ") for line in said), said
