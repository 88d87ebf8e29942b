"""Write synthetic buildings in the file layout of HM3D, with meshes and their truth if asked."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from bsg_data.errors import DatasetError
from bsg_data.executors import run_in_order
from bsg_data.files import AnyPath, encode_json, hold, write_bytes
from bsg_data.geometry.placement import STAIRS
from bsg_data.inputs.bounded_file import read_bytes
from bsg_data.inputs.bounds import SYNTHETIC
from bsg_data.inputs.documents import parse_json
from bsg_data.results import refuse_datasets
from bsg_data.scene.class_map import ClassMap, load_class_map
from bsg_data.scene.scene_graph import SceneObject
from bsg_data.sources.hm3d import HEADER, SYNTHETIC_MARK
from bsg_data.synthetic.building import (
    MAX_SCENES,
    USUAL,
    BuildingSize,
    SyntheticBuilding,
    SyntheticError,
    SyntheticRates,
    load_rates,
    name_building,
    synthesise,
)
from bsg_data.synthetic.floor_plan import draw_floor_plan
from bsg_data.synthetic.furnishing import Fixture, furnish
from bsg_data.synthetic.meshes import SIZES, Colours, UpAxis, encode_mesh, measure_truth

_UNLISTED = 3  # colours that are painted and not listed
_RATES_MAP = "hm3d45-v1"  # by whose categories the rates were fitted; another gives other bytes
_SUFFIXES = (".semantic.txt", ".semantic.glb", ".truth.json")  # of the files of a building


@dataclass(frozen=True, slots=True)
class GeometryOptions:
    """How the meshes of synthetic buildings are written.

    Attributes:
        size: `small`, or `full`, as large as a real mesh.
        coloured_by: `texture`, `vertex` or `both`.
        up_axis: the axis that points up in the files; None: y in even buildings, z in odd ones.
    """

    size: str = "small"
    coloured_by: Colours = "texture"
    up_axis: UpAxis | None = None


def write_synthetic(
    out: AnyPath,
    *,
    scenes: int,
    seed: int,
    size: BuildingSize = USUAL,
    geometry: GeometryOptions | None = None,
    force: bool = False,
    executor: Executor | None = None,
) -> Iterator[Path]:
    """Write buildings 0 to `scenes` - 1 of a seed, and yield their paths one by one.

    A `synthetic.json` in the folder marks them as synthetic, and at the end as complete.

    Args:
        out: the folder above `train` and `val`.
        scenes: 1 to 10,000,000.
        seed: 0 or more; another seed gives other buildings.
        size: size of every building.
        geometry: how to write `<hash>.semantic.glb` and, as JSON, `<hash>.truth.json` beside each
            annotation; None writes none. The annotation is the same either way.
        force: replace existing synthetic buildings.
        executor: writes buildings in parallel; None writes them one by one in this process.

    Raises:
        SyntheticError: before anything is written, if a number is out of range.
        DatasetError: before anything is written, if something is in the way.
    """
    out, rates = Path(out), load_rates()
    if seed < 0 or not 0 < scenes <= MAX_SCENES:
        raise SyntheticError(
            f"{scenes} scenes of seed {seed}: expected 1 to {MAX_SCENES} scenes, and a seed from 0",
            code="number-range",
            where=scenes,
        )
    size.require_possible(rates, meshes=geometry is not None)
    refuse_datasets(out)
    mark: dict[str, Any] = {"what": "synthetic buildings of bsg-data synth", "scenes": scenes}
    mark["seed"] = seed
    if size != USUAL:
        mark["size"] = asdict(size)
    if geometry is not None:
        mark["geometry"] = asdict(geometry)
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        message = f"{out}: cannot be made ({error.strerror})"
        raise DatasetError(message, code="not-written", where=out) from error
    out = out.absolute()  # who makes a building may stand in another folder
    with hold(out):
        _clear(out, force=force)
        _write_mark(out, mark, finished=False)
        tasks = ((rates, out, seed, number, size, geometry) for number in range(scenes))
        yield from run_in_order(_write_one, tasks, executor=executor)
        _write_mark(out, mark, finished=True)


def _write_one(
    rates: SyntheticRates,
    out: Path,
    seed: int,
    number: int,
    size: BuildingSize,
    geometry: GeometryOptions | None,
) -> Path:
    building = synthesise(rates, seed=seed, number=number, size=size)
    path = write_building(building, out)
    if geometry is not None:
        mesh, truth = shape_building(building.rows, geometry, seed=seed, number=number)
        write_bytes(path.with_suffix(".glb"), mesh)
        text = encode_json(truth, separators=(",", ":")) + "\n"
        write_bytes(path.with_name(f"{building.hash}.truth.json"), text.encode())
    return path


def write_building(building: SyntheticBuilding, out: Path) -> Path:
    """Write `OUT/<split>/<scene_id>/<hash>.semantic.txt`, whole or not at all; return its path."""
    path = out / building.split / building.scene_id / f"{building.hash}.semantic.txt"
    rows = [
        f'{one.instance_id},{one.colour},"{one.raw_category}",{one.room_index}'
        for one in building.rows
    ]
    write_bytes(path, "\n".join([HEADER, *rows, ""]).encode())
    return path


def _write_mark(out: Path, mark: dict[str, Any], *, finished: bool) -> None:
    write_bytes(out / SYNTHETIC_MARK, (encode_json({**mark, "finished": finished}) + "\n").encode())


def _clear(out: Path, *, force: bool) -> None:
    """Remove the synthetic buildings of an earlier call; never anything else."""
    begun = f".{SYNTHETIC_MARK}.partial"  # all that a command killed at its start leaves
    if not out.exists() or (out.is_dir() and {path.name for path in out.iterdir()} <= {begun}):
        return
    if not (out / SYNTHETIC_MARK).is_file():
        message = f"{out}: holds other files; choose another --out"
        raise DatasetError(message, code="path-taken", where=out)
    try:
        mark = parse_json(read_bytes(out / SYNTHETIC_MARK, SYNTHETIC, error=DatasetError))
        names = _file_names(mark["seed"], mark["scenes"], BuildingSize(**mark.get("size", {})))
        if mark["finished"] and not force:
            message = f"{out}: holds synthetic buildings; --force replaces them"
            raise DatasetError(message, code="path-taken", where=out)
        ours = set(names)
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise DatasetError(
            f"{out / SYNTHETIC_MARK}: does not say which buildings are synthetic; move {out} away",
            code="mark-broken",
            where=out / SYNTHETIC_MARK,
        ) from error
    found = [p for name in ("train", "val") for p in (out / name).rglob("*") if not p.is_dir()]
    for path in found:
        name = path.with_name(path.name.removeprefix(".").removesuffix(".partial"))
        if name.relative_to(out).as_posix() not in ours:
            raise DatasetError(
                f"{out}: holds {path.relative_to(out).as_posix()}, which is none of these "
                "synthetic buildings; move it away, then --force",
                code="foreign-file",
                where=path,
            )
    _write_mark(out, mark, finished=False)  # from now on some are gone
    for path in found:
        path.unlink()
    for split in ("train", "val"):
        for folder in (*(out / split).glob("*/"), out / split):
            with suppress(OSError):  # there is none, or it is not empty
                folder.rmdir()


def _file_names(seed: int, scenes: int, size: BuildingSize) -> Iterator[str]:
    for number in range(scenes):
        split, scene_id, name = name_building(seed, number, size)
        yield from (f"{split}/{scene_id}/{name}{suffix}" for suffix in _SUFFIXES)


def shape_building(
    rows: tuple[SceneObject, ...], options: GeometryOptions, *, seed: int, number: int
) -> tuple[bytes, dict[str, Any]]:
    """Return the GLB of a building and its true geometry; equal arguments give equal bytes.

    Args:
        rows: its annotation; what is listed in the null region is put into any room.
        options: how the mesh is written.
        seed: of the set of buildings.
        number: the building's place in the set.
    """
    rng = np.random.Generator(np.random.PCG64(np.random.SeedSequence((seed, number, 1))))
    size = SIZES[options.size]
    up_axis: UpAxis = options.up_axis or ("y" if number % 2 == 0 else "z")
    regions = sorted({row.room_index for row in rows if row.room_index >= 0})
    fixtures = _list_fixtures(rows, regions, load_class_map(_RATES_MAP), rng)
    with_stairs = {fixture.room for fixture in fixtures if fixture.category in STAIRS}
    plan = draw_floor_plan(len(regions), with_stairs=with_stairs, rng=rng)
    surfaces = furnish(plan, fixtures, texel=size.texel, rng=rng)
    mesh = encode_mesh(
        surfaces,
        _draw_colours(rows, rng),
        size=size,
        up_axis=up_axis,
        coloured_by=options.coloured_by,
        rng=rng,
    )
    truth = measure_truth(surfaces, plan, regions=regions, texel=size.texel)
    return mesh, {"up_axis": up_axis, "texel": size.texel, **truth}


def _list_fixtures(
    rows: tuple[SceneObject, ...],
    regions: list[int],
    class_map: ClassMap,
    rng: np.random.Generator,
) -> list[Fixture]:
    place = {region: room for room, region in enumerate(regions)}
    fixtures = []
    for row in rows:
        entry = class_map.lookup(row.raw_category)
        room = place.get(row.room_index)
        if room is None:
            room = int(rng.integers(len(regions)))
        category = entry.category if entry else None
        fixtures.append(Fixture(row.instance_id, category or "", room))
    return fixtures


def _draw_colours(rows: tuple[SceneObject, ...], rng: np.random.Generator) -> npt.NDArray[np.uint8]:
    """Return the colour of every label `[L, 3]`: background, instances by id, unlisted ones."""
    listed = {row.instance_id: int(str(row.colour), 16) for row in rows}
    taken = {0, *listed.values()}
    free = [int(c) for c in rng.integers(1, 0xFFFFFF, 64) if int(c) not in taken][:_UNLISTED]
    codes = [0, *(listed.get(label, 0) for label in range(1, max(listed) + 1)), *free]
    return np.array([[code >> 16, code >> 8 & 255, code & 255] for code in codes], dtype=np.uint8)
