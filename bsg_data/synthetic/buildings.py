"""Write synthetic buildings in the file layout of HM3D, each with a room layout."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from bsg_data.errors import DatasetError, RecipeError
from bsg_data.files import AnyPath, encode_json, resolve_links, write_bytes
from bsg_data.inputs.bounded_file import read_bytes
from bsg_data.inputs.documents import parse_json
from bsg_data.places import FolderKind
from bsg_data.results import write_folder
from bsg_data.sources.hm3d import HEADER, SYNTHETIC_MARK
from bsg_data.synthetic.building import (
    SyntheticBuilding,
    name_building,
    synthesise,
)
from bsg_data.synthetic.floor_plan import draw_layout

LAYOUTS = "layouts"  # the folder of the layouts


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
    with write_folder(out, _SYNTHETIC, plan=text, force=force) as (folder, done):
        if not done:
            write_bytes(folder / SYNTHETIC_MARK, text)
        for number in range(scenes):
            building = synthesise(seed=seed, number=number)
            if not done:
                _write_one(building, folder, seed=seed, number=number)
            yield out / _name_annotation(building.split, building.scene_id, building.hash)


def _write_one(building: SyntheticBuilding, folder: Path, *, seed: int, number: int) -> None:
    layout = draw_layout(building, seed=seed, number=number)
    write_bytes(folder / _name_layout(building.scene_id), layout.encode())
    rows = [f'{one.instance_id},{one.colour},"{one.name}",{one.region_id}' for one in building.rows]
    path = folder / _name_annotation(building.split, building.scene_id, building.hash)
    write_bytes(path, "\n".join([HEADER, *rows, ""]).encode())


def _name_annotation(split: str, scene_id: str, building: str) -> str:
    return f"{split}/{scene_id}/{building}.semantic.txt"


def _name_layout(scene_id: str) -> str:
    return f"{LAYOUTS}/{scene_id}.yaml"


def _list_own(folder: Path) -> set[str]:
    """Return the files of a folder of synthetic buildings, by what its mark says."""
    path = folder / SYNTHETIC_MARK
    try:
        mark = parse_json(read_bytes(path, error=DatasetError))
        return {*_list_names(int(mark["seed"]), mark["scenes"])}
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise DatasetError(
            f"{path}: does not say which buildings are synthetic; move {folder} away",
            code="mark-broken",
            where=path,
        ) from error


def _list_names(seed: int, scenes: int) -> Iterator[str]:
    yield SYNTHETIC_MARK
    for number in range(scenes):
        split, scene_id, building = name_building(seed, number)
        yield _name_annotation(split, scene_id, building)
        yield _name_layout(scene_id)


_SYNTHETIC = FolderKind("folder of synthetic buildings", mark=SYNTHETIC_MARK, lists=_list_own)
