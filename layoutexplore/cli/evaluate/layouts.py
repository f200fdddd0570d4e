"""`layoutexplore evaluate layout`: layouts of grid maps against floor plans."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer

from layoutexplore.cli.evaluate.options import JsonFile, write_numbers
from layoutexplore.cli.evaluate.segmentation import Methods, Resolution
from layoutexplore.files import check_places


def evaluate_layout(
    folder: Annotated[Path, typer.Argument(help="Folder with NAME.png and NAME_gt.xml.")],
    method: Methods = None,
    resolution: Resolution = 0.1,
    json_file: JsonFile = None,
) -> None:
    """Layouts of grid maps against floor plans, stretched onto the walls: A_FC and A_BC (IAS-15).

    A floor plan is held against its map as it is and mirrored in y; the way round that fits the map's free
    space better is scored, and "truth mirrored" says so.
    """
    import numpy as np

    from layoutexplore.errors import MapError
    from layoutexplore.evaluation.layouts import facing_outlines, read_outlines, score_layout
    from layoutexplore.grids.ros_map import load_grid
    from layoutexplore.layout.pipeline import layout_method, reconstruct

    check_places(None, json_file)
    if not folder.is_dir():
        raise MapError(f"{folder}: no such folder")
    for name in method or ():
        layout_method(name)
    pairs = [(p, p.with_name(f"{p.stem}_gt.xml")) for p in sorted(folder.glob("*.png"))]
    pairs = [(image, truth) for image, truth in pairs if truth.is_file()]
    if not pairs:
        raise MapError(f"{folder}: no map NAME.png with its floor plan NAME_gt.xml")
    rows: list[dict[str, Any]] = []
    for name in dict.fromkeys(method or ["default"]):
        for image, truth in pairs:
            grid = load_grid(image, resolution=resolution)
            rooms, is_mirrored = facing_outlines(read_outlines(truth), grid)
            found = reconstruct(grid, name)
            row = {"map": image.stem, "method": name} | asdict(score_layout(found, rooms))
            rows.append(row | {"truth_mirrored": is_mirrored, "ms": 1000 * found.seconds})
            typer.echo(
                f"{image.stem} {name}: A_FC {100 * row['a_fc']:.1f} A_BC {100 * row['a_bc']:.1f} "
                f"P {100 * row['precision']:.1f} R {100 * row['recall']:.1f}  "
                f"{row['rooms']}/{row['true_rooms']} rooms{', truth mirrored' if is_mirrored else ''}"
            )
        part = [r for r in rows if r["method"] == name]
        means = []
        for key in ("a_fc", "a_bc", "precision", "recall"):
            values = [100 * r[key] for r in part]
            means.append(f"{key} {np.mean(values):.1f}±{np.std(values):.1f}")
        typer.echo(f"{name}, {len(part)} maps: {', '.join(means)}")
    write_numbers(json_file, {"resolution": resolution, "maps": rows})
