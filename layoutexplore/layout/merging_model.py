"""The forest that judges pairs of pieces: plain numbers in a JSON file beside this module.

The one that ships was trained on the maps of the room segmentation survey (empty and furnished), of ROSE2's study of clutter
and of a building while it was explored, 40 in all, and on maps simulated from school, university and generated floor plans:

    layoutexplore evaluate train bormann bormann_furnished cluttered fr79_incremental --buildings buildings.csv \
        --plans schools --plans kth --weight cluttered=4 --weight fr79_incremental=4 --out merging_model.json

Trained so, but without the building that is scored (`evaluate segmentation` with the same options and `--folds 5 --seeds 3`),
it reaches IoU_s / one-to-one of 96.3 / 89.3 on the empty maps, 88.7 / 80.6 on the furnished, 85.5 / 74.8 on the cluttered and
88.1 / 77.3 on those of the exploration, with standard deviations over the seeds of up to 1.9. The weights, the level at which
pieces merge, and what the lines tell were chosen with these maps at hand.
"""

from __future__ import annotations

import json
from functools import lru_cache
from itertools import pairwise
from pathlib import Path

import numpy as np

from layoutexplore.errors import ConfigError
from layoutexplore.forest import Forest
from layoutexplore.layout.merging import FEATURES

MODEL_PATH = Path(__file__).with_name("merging_model.json")
"""The shipped model; `layoutexplore.layout.merging_training` makes it."""


def save_forest(forest: Forest, path: Path, *, note: str = "") -> None:
    """Write a forest: one list of [feature, threshold, left, right] a tree, a leaf as [-1, log-odds, 0, 0]."""
    trees = []
    bounds = [*forest.roots.tolist(), len(forest.feature)]
    for begin, end in pairwise(bounds):
        trees.append(
            [
                [int(forest.feature[i]), float(forest.threshold[i]), *(int(v - begin) for v in (forest.left[i], forest.right[i]))]
                if forest.feature[i] >= 0
                else [-1, float(forest.threshold[i]), 0, 0]
                for i in range(begin, end)
            ]
        )
    lines = ",\n".join(json.dumps(t, separators=(",", ":")) for t in trees)
    head = json.dumps({"note": note, "features": list(FEATURES), "bias": forest.bias})
    path.write_text(f'{head[:-1]}, "trees": [\n{lines}\n]}}\n', encoding="utf-8")


@lru_cache(maxsize=4)
def load_forest(path: Path = MODEL_PATH) -> Forest:
    """Read a forest.

    Raises:
        ConfigError: The file was made for other features.
    """
    data = json.loads(path.read_text(encoding="utf-8"))
    if tuple(data["features"]) != FEATURES:
        raise ConfigError(f"{path} judges other features than this version computes: train it again")
    nodes: list[list[float]] = []
    roots = []
    for tree in data["trees"]:
        base = len(nodes)
        roots.append(base)
        nodes.extend([f, t, left + base, right + base] for f, t, left, right in tree)
    table = np.array(nodes, np.float64).reshape(-1, 4)
    ints = np.ascontiguousarray(table[:, [0, 2, 3]].T).astype(np.int32)
    return Forest(ints[0], np.ascontiguousarray(table[:, 1]), ints[1], ints[2], np.array(roots, np.int32), float(data["bias"]))
