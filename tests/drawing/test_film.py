"""Films: frames to a file of either kind, and nothing where that breaks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from layoutexplore.drawing.film import Film
from layoutexplore.errors import ConfigError, WriteError


@pytest.mark.parametrize("suffix", [".gif", ".mp4"])
def test_films_are_written(tmp_path: Path, suffix: str) -> None:
    import imageio.v2 as imageio

    path = tmp_path / "deep" / f"film{suffix}"
    with Film(str(path), fps=8) as film:
        for k in range(4):
            film.add(np.full((64, 96, 3), 60 * k, np.uint8))
    frames = imageio.mimread(path)
    assert len(frames) >= 4 and frames[0].shape[:2] == (64, 96)
    assert [p.name for p in path.parent.iterdir()] == [path.name]


def test_frames_of_a_gif_come_back_as_they_were_and_do_not_pile_up(tmp_path: Path) -> None:
    import tracemalloc

    import imageio.v3 as imageio

    path, taken = tmp_path / "film.gif", list[int]()
    picture = np.zeros((200, 300, 3), np.uint8)
    tracemalloc.start()
    with Film(path, fps=12) as film:
        for k in range(40):
            if k % 5:  # every fifth frame is the one before
                picture[4 * k : 4 * k + 9, 7 * k : 7 * k + 12] = (6 * k, 255 - 5 * k, 40)
            film.add(picture)
            taken.append(tracemalloc.get_traced_memory()[0])
    tracemalloc.stop()
    assert taken[-1] - taken[9] < picture.nbytes
    found = imageio.imread(path, index=None)
    assert len(found) == 40 + round(1.5 * 12)
    assert np.abs(found[39].astype(int) - picture).max() <= 4
    assert imageio.immeta(path, index=1)["duration"] == pytest.approx(1000 / 12, abs=10)


def test_a_film_that_breaks_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError), Film(tmp_path / "film.gif") as film:
        film.add(np.zeros((64, 96, 3), np.uint8))
        raise ZeroDivisionError
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("frames", [1, 200])
@pytest.mark.parametrize("suffix", [".gif", ".mp4"])
def test_a_film_without_room_on_the_disk_is_an_error_and_leaves_the_one_before(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], suffix: str, frames: int
) -> None:
    import resource

    path = tmp_path / f"film{suffix}"
    path.write_bytes(b"the film before")
    noise = np.random.default_rng(0).integers(0, 256, (frames, 120, 160, 3), np.uint8)
    limit = resource.getrlimit(resource.RLIMIT_FSIZE)
    film = Film(path)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limit[1]))
    try:
        with pytest.raises(WriteError, match=r"film\.\w+: cannot write the film: .*[a-z]$"), film:
            for frame in noise:
                film.add(frame)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limit)
    assert path.read_bytes() == b"the film before"
    assert list(tmp_path.iterdir()) == [path]
    assert capfd.readouterr().err == ""


def test_a_gif_of_two_colours_says_nothing(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    frame = np.zeros((64, 96, 3), np.uint8)
    frame[::2] = np.arange(96)[:, None] * 2
    frame[::3, :, 1] = 7
    with Film(tmp_path / "film.gif") as film:
        film.add(frame)
    assert capfd.readouterr().err == ""


def test_films_of_other_kinds(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"\.mp4 or \.gif"):
        Film(tmp_path / "film.avi")
    with pytest.raises(ConfigError, match="frames per second"):
        Film(tmp_path / "film.gif", fps=0)
