"""Write synthetic buildings in the file layout of HM3D, with similar statistics.

A building has rooms, each of a latent type with a mean count per category. Counts vary with the
building's richness and its style (a factor per category), with the room's size, and with a burst
per room and category. Names then get HM3D's raw spellings, and the file its irregularities. Every
rate comes from `rates.json`, which `scripts/fit/synthetic_rates.py` at commit 4227eff fitted on
HM3D.
docs/synthetic.md has the model, and docs/results/synthetic.md how close it is.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import ExitStack, suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from bsg_data.errors import DatasetError
from bsg_data.executors import run_in_order
from bsg_data.files import AnyPath, encode_json, write_bytes
from bsg_data.inputs.bounded_file import read_bytes
from bsg_data.inputs.bounds import SYNTHETIC
from bsg_data.inputs.documents import parse_json
from bsg_data.lock import hold
from bsg_data.result_folder import refuse_datasets
from bsg_data.scene.scene_graph import SceneObject
from bsg_data.sources.annotations import HEADER
from bsg_data.sources.hm3d import SYNTHETIC_MARK
from bsg_data.synthetic.building_size import BuildingSize, draw_many_types, share_objects
from bsg_data.synthetic.geometry import GeometryOptions, shape_building
from bsg_data.synthetic.rates import SyntheticError, SyntheticRates, load_rates

HM3D_SCENES = 900  # HM3D numbers 800 train scenes from 00000 and 100 val scenes from 00800
FIRST_VAL_ID = 800
VAL_EVERY = 9  # the last of every nine numbers is in val: 100 of 900, 2 of 20
NULL_REGION = -1
MAX_SCENES = 10_000_000  # the digits of a scene id number no more
USUAL = BuildingSize()  # as the rates say
_SPLITS = ("train", "val")
_SUFFIXES = (".semantic.txt", ".semantic.glb", ".truth.json")  # of the files of a building
_FINISHED = b'"finished": true'
_ALPHABET = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789"

Floats = npt.NDArray[np.float64]
Placed = tuple[str, int]  # raw name, region id


@dataclass(frozen=True, slots=True)
class SyntheticBuilding:
    """One synthetic building.

    Attributes:
        scene_id: five digits or more, a dash and the hash, for example `00017-8bHk3aXq1Zc`.
        hash: eleven letters and digits.
        split: `train` or `val`.
        rows: in the order of the file.
        room_types: the true latent type of every region, as (region id, index of the type).
    """

    scene_id: str
    hash: str
    split: str
    rows: tuple[SceneObject, ...]
    room_types: tuple[tuple[int, int], ...] = field(repr=False)


def synthesise(
    rates: SyntheticRates, *, seed: int, number: int, size: BuildingSize = USUAL
) -> SyntheticBuilding:
    """Sample one building; it depends only on rates, seed, number and size.

    Args:
        rates: what to draw from.
        seed: 0 or more; names a set of buildings.
        number: 0 to 9,999,999; the building's place in the set. The first 900 have the ids of HM3D,
            whose val buildings follow its train buildings; that of a later one is its number.
        size: of the building; another size gives another building.

    Raises:
        SyntheticError: if the seed, the number or the size is out of range.
    """
    _check_seed(seed)
    if not 0 <= number < MAX_SCENES:
        raise SyntheticError(
            f"there is no building number {number}: expected 0 to {MAX_SCENES - 1}"
        )
    size.require_possible(rates, meshes=False)
    rng = np.random.Generator(np.random.PCG64(np.random.SeedSequence((seed, number))))
    types = draw_room_types(rates, rng, rooms=size.rooms)
    regions = _draw_regions(rates, len(types), rng)
    counts = _draw_counts(rates, types, rng)
    if size.objects is not None:
        counts = share_objects(counts, size.objects, rng)
    rows = _number_rows(rates, _draw_names(rates, types, regions, counts, rng), rng)
    name = _hash(seed, number, size)
    split = "val" if number % VAL_EVERY == VAL_EVERY - 1 else "train"
    room_types = tuple(zip(regions, types, strict=True))
    return SyntheticBuilding(f"{_scene_number(number):05d}-{name}", name, split, rows, room_types)


def _scene_number(number: int) -> int:
    if number >= HM3D_SCENES:
        return number
    nines, place = divmod(number, VAL_EVERY)
    return FIRST_VAL_ID + nines if place == VAL_EVERY - 1 else number - nines


def _check_seed(seed: int) -> None:
    if seed < 0:
        raise SyntheticError(f"the seed is {seed}; expected 0 or more")


def _hash(seed: int, number: int, size: BuildingSize) -> str:
    said = f"synthetic/{seed}/{number}" + ("" if size == USUAL else f"/{size.name}")
    value = int.from_bytes(hashlib.sha256(said.encode()).digest(), "big")
    return "".join(_ALPHABET[value // 62**place % 62] for place in range(11))


def draw_room_types(
    rates: SyntheticRates, rng: np.random.Generator, *, rooms: int | None = None
) -> tuple[int, ...]:
    """Sample how many rooms are of each type given their sum, which is sampled if None; shuffled.

    Of more rooms than any fitted building has each is sampled by itself.
    """
    total = _pick(np.array(rates.rooms), rng) if rooms is None else rooms
    if total >= len(rates.rooms):
        types = draw_many_types(rates, total, rng)
    else:
        types = _draw_fitted_types(rates, total, rng)
    return tuple(int(kind) for kind in rng.permutation(types))


def _draw_fitted_types(rates: SyntheticRates, total: int, rng: np.random.Generator) -> list[int]:
    """Sample the types of a number of rooms that fitted buildings have, in order of types."""
    counts = next(counts for most, counts in rates.bins if total <= most)
    rest = [np.eye(1, total + 1)[0]]  # rest[k][n]: weight of n rooms in the types from k on
    for weights in reversed(counts):
        ways = np.convolve(rest[0], weights)[: total + 1]
        rest.insert(0, ways / ways.sum())
    types: list[int] = []
    for kind, weights in enumerate(counts):
        left = total - len(types)
        some = np.array(weights[: left + 1])
        types += [kind] * _pick(some * rest[kind + 1][left - np.arange(len(some))], rng)
    return types


def _pick(weights: Floats, rng: np.random.Generator) -> int:
    """Sample an index in proportion to weights, which need not sum to 1."""
    ends = np.cumsum(weights)
    return int(np.searchsorted(ends, rng.random() * ends[-1], side="right"))


def _urn(drawn: list[Any], novelty: float, weights: Floats, rng: np.random.Generator) -> int:
    """Sample from a Polya urn, by weight or again what was drawn before, and remember the draw."""
    new = rng.random() * (novelty + len(drawn)) < novelty
    drawn.append(_pick(weights, rng) if new else drawn[int(rng.integers(len(drawn)))])
    return int(drawn[-1])


def _draw_regions(rates: SyntheticRates, rooms: int, rng: np.random.Generator) -> tuple[int, ...]:
    """Sample ascending region ids, which mostly count from 0."""
    regions = np.arange(rooms) + int(rng.random() < rates.starts_at_one)
    if rng.random() < rates.gap and rooms > 1:
        regions[rng.integers(1, rooms) :] += rng.integers(1, 4)
    return tuple(int(region) for region in regions)


def _draw_counts(
    rates: SyntheticRates, types: tuple[int, ...], rng: np.random.Generator
) -> npt.NDArray[np.int64]:
    """Sample counts per room and category `[R, C + 1]`; no room is empty."""
    regular, structure = np.array(rates.regularity), np.array(rates.structure)
    style, burst, rich = np.array(rates.style), np.array(rates.burst), np.array(rates.richness)
    building = rng.gamma(1 / rich, rich)[structure] * rng.gamma(1 / style, style)
    counts = np.zeros((len(types), len(regular)), dtype=np.int64)
    for room, kind in enumerate(types):
        mean, size = np.array(rates.rates[kind]), rates.sizes[kind]
        while not counts[room].any():
            fixed = np.floor(regular * mean + rng.random(len(mean))).astype(np.int64)
            follows = np.where(structure == 1, rates.growth, 1.0)
            grown = 1 + follows * (rng.gamma(1 / size, size) - 1)
            varying = (1 - regular) * mean * building * grown * rng.gamma(1 / burst, burst)
            counts[room] = fixed + rng.poisson(varying)
    return counts


def _draw_names(
    rates: SyntheticRates,
    types: tuple[int, ...],
    regions: tuple[int, ...],
    every: npt.NDArray[np.int64],
    rng: np.random.Generator,
) -> list[Placed]:
    """Sample the name and region of every instance from counts `[R, C + 1]`, room by room."""
    usual = np.array(rates.rates)[:, :-1] + 1e-9
    scarce = usual.mean(axis=0) <= np.median(usual.mean(axis=0))  # stand in for the rare ones
    weights = [np.array([weight for _, weight in known]) for known in rates.spellings]
    stand_ins: list[int] = []
    spelt: list[list[int]] = [[] for _ in rates.categories]
    placed = []
    for region, kind, counts in zip(regions, types, every, strict=True):
        present = np.flatnonzero(counts)
        listed = np.argsort(np.array(rates.order)[present] + rng.normal(0, 0.25, len(present)))
        for chosen in np.repeat(present[listed], counts[present[listed]]):
            category = int(chosen)
            if category == len(rates.categories):
                category = _urn(stand_ins, rates.novelty[1], usual[kind] * scarce, rng)
            spelling = _urn(spelt[category], rates.novelty[0], weights[category], rng)
            placed.append((rates.spellings[category][spelling][0], region))
    return placed


def _number_rows(
    rates: SyntheticRates, placed: list[Placed], rng: np.random.Generator
) -> tuple[SceneObject, ...]:
    """Fill the null region, move strays away from their rooms, and give ids and colours."""
    listed = list(placed)
    if rng.random() < rates.null_region:
        listed += [(placed[int(i)][0], NULL_REGION) for i in rng.integers(0, len(placed), 3)]
    for _ in range(rng.poisson(rates.stray * len({region for _, region in placed}))):
        moved = listed.pop(int(rng.integers(len(listed))))
        listed.insert(int(rng.integers(len(listed) + 1)), moved)
    colours = rng.choice(0xFFFFFF, size=len(listed), replace=False) + 1  # black is no instance
    rows = [
        SceneObject(0, index, region, name, colour=f"{colour:X}")
        for index, ((name, region), colour) in enumerate(zip(listed, colours, strict=True), 1)
    ]
    if rng.random() < rates.shuffled:
        rows = [rows[int(i)] for i in rng.permutation(len(rows))]
    return tuple(rows)


def write_building(building: SyntheticBuilding, out: Path) -> Path:
    """Write `OUT/<split>/<scene_id>/<hash>.semantic.txt`, whole or not at all; return its path."""
    path = out / building.split / building.scene_id / f"{building.hash}.semantic.txt"
    rows = [
        f'{one.instance_id},{one.colour},"{one.raw_category}",{one.room_index}'
        for one in building.rows
    ]
    write_bytes(path, "\n".join([HEADER, *rows, ""]).encode())
    return path


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
    out = Path(out)
    _check_seed(seed)
    if not 0 < scenes <= MAX_SCENES:
        raise SyntheticError(f"{scenes} scenes asked for, expected 1 to {MAX_SCENES}")
    rates = load_rates()
    size.require_possible(rates, meshes=geometry is not None)
    refuse_datasets(out)
    mark: dict[str, Any] = {"what": "synthetic buildings of bsg-data synth", "scenes": scenes}
    mark["seed"] = seed
    if size != USUAL:
        mark["size"] = asdict(size)
    if geometry is not None:
        mark["geometry"] = asdict(geometry)
    with ExitStack() as lock:
        _make_parent(out)
        lock.enter_context(hold(out))
        _clear(out, force=force)
        write_bytes(out / SYNTHETIC_MARK, _encode(mark, finished=False))
        return _write_all(rates, out, mark, size, geometry, executor, lock=lock.pop_all())


def _make_parent(out: Path) -> None:
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise DatasetError(f"{out}: cannot be made ({error.strerror})") from error


def _write_all(
    rates: SyntheticRates,
    out: Path,
    mark: dict[str, Any],
    size: BuildingSize,
    geometry: GeometryOptions | None,
    executor: Executor | None,
    *,
    lock: ExitStack,
) -> Iterator[Path]:
    """Write the buildings while the lock is held, and say at the end that all are there."""
    with lock:
        yield from _write_each(rates, out, mark, size, geometry, executor)
        write_bytes(out / SYNTHETIC_MARK, _encode(mark, finished=True))


def _write_each(
    rates: SyntheticRates,
    out: Path,
    mark: dict[str, Any],
    size: BuildingSize,
    geometry: GeometryOptions | None,
    executor: Executor | None,
) -> Iterator[Path]:
    if executor is not None:
        out = out.absolute()  # who makes a building may stand in another folder
    numbers = range(mark["scenes"])
    tasks = ((rates, out, mark["seed"], number, size, geometry) for number in numbers)
    yield from run_in_order(_write_one, tasks, executor=executor)


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


def _encode(mark: dict[str, Any], *, finished: bool) -> bytes:
    return (encode_json({**mark, "finished": finished}) + "\n").encode()


def _clear(out: Path, *, force: bool) -> None:
    """Remove the synthetic buildings of an earlier call; never anything else."""
    begun = f".{SYNTHETIC_MARK}.partial"  # all that a command killed at its start leaves
    if not out.exists() or (out.is_dir() and {path.name for path in out.iterdir()} <= {begun}):
        return
    mark = out / SYNTHETIC_MARK
    if not mark.is_file():
        raise DatasetError(f"{out}: holds other files; choose another --out")
    said = read_bytes(mark, SYNTHETIC, error=DatasetError)
    if not force and _FINISHED in said:
        raise DatasetError(f"{out}: holds synthetic buildings; --force replaces them")
    ours = list(_list_own(out, said))
    write_bytes(mark, said.replace(_FINISHED, b'"finished": false'))  # from now on some are gone
    for path in ours:
        path.unlink()
    for split in _SPLITS:
        for folder in (*(out / split).glob("*/"), out / split):
            with suppress(OSError):  # there is none, or it is not empty
                folder.rmdir()


def _list_own(out: Path, mark: bytes) -> Iterator[Path]:
    """Yield the files of the buildings that a mark speaks of; their ids follow from its seed.

    Raises:
        DatasetError: naming whatever else is in their folders.
    """
    try:
        said = parse_json(mark)
        seed, scenes = int(said["seed"]), int(said["scenes"])
        size = BuildingSize(**said.get("size", {}))
    except (ValueError, TypeError, KeyError, AttributeError, OverflowError) as error:
        raise DatasetError(
            f"{out / SYNTHETIC_MARK}: does not say which buildings are synthetic; move {out} away"
        ) from error
    for split in _SPLITS:
        if (out / split).is_symlink():
            raise DatasetError(f"{out / split}: is a link; remove it, then --force")
        for path in sorted((out / split).rglob("*")):
            if path.is_dir() and not path.is_symlink():
                continue
            number = _number_of(path.parent.name, split)
            name = _hash(seed, number, size)
            files = {f"{name}{suffix}" for suffix in _SUFFIXES}
            is_ours = number < scenes and path.parent.name == f"{_scene_number(number):05d}-{name}"
            own = path.name.removeprefix(".").removesuffix(".partial")
            if not is_ours or own not in files or path.parent.parent != out / split:
                where = path.relative_to(out).as_posix()
                raise DatasetError(
                    f"{out}: holds {where}, which is none of these synthetic buildings; move it "
                    "away, then --force"
                )
            yield path


def _number_of(scene_id: str, split: str) -> int:
    """Return the number of the building that would have a scene id; the hash is not looked at."""
    digits = scene_id.partition("-")[0]
    if not (digits.isascii() and digits.isdigit() and len(digits) <= len(str(MAX_SCENES))):
        return MAX_SCENES  # no building has it
    scene = int(digits)
    if scene >= HM3D_SCENES:
        return scene
    if split == "val":
        return max(0, scene - FIRST_VAL_ID) * VAL_EVERY + VAL_EVERY - 1
    return scene + scene // (VAL_EVERY - 1)
