"""Write synthetic buildings in the file layout of HM3D, each with a room layout."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from bsg_data.errors import RecipeError
from bsg_data.files import AnyPath, encode_json, resolve_links, write_bytes
from bsg_data.results import write_results
from bsg_data.sources.hm3d import HEADER, SYNTHETIC_MARK
from bsg_data.synthetic.building import synthesise
from bsg_data.synthetic.floor_plan import draw_layout

_LAYOUTS = "layouts"  # the folder of the layouts


def write_synthetic(
    out: AnyPath,
    *,
    scenes: int,
    seed: int,
    force: bool = False,
) -> Iterator[Path]:
    """Write buildings 0 to `scenes` - 1 of a seed, and yield the paths of their annotations.

    `layouts/<scene_id>.yaml` has the layout of a building, for `WithLayouts`.
    A `synthetic.json` in the folder marks all as synthetic. The folder appears, whole, when the
    last path was taken.

    Args:
        out: the folder above `train`, `val` and `layouts`.
        scenes: 1 or more.
        seed: 0 or more; another seed gives other buildings.
        force: replace existing synthetic buildings.

    Raises:
        RecipeError: before anything is written, if a number is out of range.
        DatasetError: before anything is written, if something is in the way.
    """
    if seed < 0 or scenes < 1:
        raise RecipeError(
            f"{scenes} scenes of seed {seed}: expected 1 scene or more, and a seed from 0",
            code="number-range",
            where=scenes,
        )
    mark = {"what": "synthetic buildings of bsg-data synth", "scenes": scenes, "seed": seed}
    text = (encode_json(mark) + "\n").encode()
    out = resolve_links(out)
    with write_results(out, report=SYNTHETIC_MARK, force=force) as folder:
        write_bytes(folder / SYNTHETIC_MARK, text)
        for number in range(scenes):
            yield out / _write_one(folder, seed=seed, number=number)


def _write_one(folder: Path, *, seed: int, number: int) -> str:
    """Write a building and its layout, and return the name of its annotation."""
    building = synthesise(seed=seed, number=number)
    layout = draw_layout(building, seed=seed, number=number)
    write_bytes(folder / _LAYOUTS / f"{building.scene_id}.yaml", layout.encode())
    rows = [f'{row.instance_id},{row.colour},"{row.name}",{row.region_id}' for row in building.rows]
    name = f"{building.split}/{building.scene_id}/{building.hash}.semantic.txt"
    write_bytes(folder / name, "\n".join([HEADER, *rows, ""]).encode())
    return name
