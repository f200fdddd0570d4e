"""A results folder of many runs without running them: those of a small one, copied under other names."""

from __future__ import annotations

import dataclasses
import shutil
from collections.abc import Iterator
from pathlib import Path

from layoutexplore.benchmark.rows import Row
from layoutexplore.benchmark.store import ResultsFolder
from layoutexplore.files import to_toml


def many_runs(small: ResultsFolder, path: Path, *, plans: int, starts: int) -> ResultsFolder:
    """A folder with the agents and sensors of a small one on copies of its first plan and start.

    Metres differ from copy to copy, so that no two ratios are one; curves, rasters and recordings are links.
    """
    large = ResultsFolder(path)
    first = min((row.plan, row.start) for row in small.rows())
    models = [row for row in small.rows() if (row.plan, row.start) == first]
    manifest = small.manifest()
    entry = manifest["plans"][first[0]]
    manifest["plans"] = {f"plan-{k:03d}": {**entry, "name": f"plan-{k:03d}"} for k in range(plans)}
    path.mkdir(parents=True)
    (path / "run.toml").write_text(to_toml({**manifest, "starts": starts}))
    rows = list(_copies(models, plans, starts))
    large.rewrite(rows)
    (path / "plans").mkdir()
    for name in manifest["plans"]:
        shutil.copy(small.raster_path(first[0]), large.raster_path(name))
    sources = {(row.sensor, row.agent): small.curve_path(row) for row in models}
    for row in rows:
        target = large.curve_path(row)
        target.parent.mkdir(parents=True, exist_ok=True)
        target.hardlink_to(sources[row.sensor, row.agent])
    return large


def _copies(models: list[Row], plans: int, starts: int) -> Iterator[Row]:
    for plan in range(plans):
        for start in range(starts):
            for k, row in enumerate(models):
                factor = 1 + 0.01 * ((7 * plan + 3 * start + 5 * k) % 41)
                metres = {name: getattr(row, name) * factor for name in ("d90", "d95", "d99")}
                yield dataclasses.replace(row, plan=f"plan-{plan:03d}", start=start, **metres)
