"""Films: frames to a file of either kind, and nothing where that breaks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from layoutexplore.drawing.film import Film
from layoutexplore.errors import ConfigError


@pytest.mark.parametrize("suffix", [".gif", ".mp4"])
def test_films_are_written(tmp_path: Path, suffix: str) -> None:
    import imageio.v2 as imageio

    path = tmp_path / "deep" / f"film{suffix}"
    with Film(path, fps=8) as film:
        for k in range(4):
            film.add(np.full((64, 96, 3), 60 * k, np.uint8))
    frames = imageio.mimread(path)
    assert len(frames) >= 4 and frames[0].shape[:2] == (64, 96)
    assert [p.name for p in path.parent.iterdir()] == [path.name]


def test_a_film_that_breaks_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError), Film(tmp_path / "film.gif") as film:
        film.add(np.zeros((64, 96, 3), np.uint8))
        raise ZeroDivisionError
    assert not list(tmp_path.iterdir())


def test_films_of_other_kinds(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"\.mp4 or \.gif"):
        Film(tmp_path / "film.avi")
    with pytest.raises(ConfigError, match="frames per second"):
        Film(tmp_path / "film.gif", fps=0)
