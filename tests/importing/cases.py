"""Small buildings as maps and pictures."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

Picture = NDArray[np.uint8]


def office(*, unknown: int = 205, free: int = 254) -> Picture:
    """A corridor of 12 x 2 m with three rooms of 4 x 4 m above it, doors of 0.9 m, at 0.05 m a pixel."""
    image = np.full((200, 320), unknown, np.uint8)
    image[30:158, 30:280] = 0
    image[114:154, 34:276] = free
    for left in (34, 116, 198):
        image[34:110, left : left + 78] = free
        image[110:114, left + 30 : left + 48] = free
    return image


def write_ros_map(folder: Path, image: Picture, *, more: str = "", name: str = "floor") -> Path:
    """A map as Nav2's map_saver writes it."""
    cv2.imwrite(str(folder / f"{name}.pgm"), image)
    path = folder / f"{name}.yaml"
    path.write_text(
        f"image: {name}.pgm\nmode: trinary\nresolution: 0.05\norigin: [-3.0, -2.0, 0]\nnegate: 0\n"
        f"occupied_thresh: 0.65\nfree_thresh: 0.25\n{more}"
    )
    return path
