"""Datasets, their manifest and every table: `bsg_data.dataset` and `bsg_data.checks`."""

from __future__ import annotations

import hashlib
import json
import tempfile
from functools import cache
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from bsg_data import HM3DFolder, PairsRecipe, SplitRecipe, build_dataset, split_dataset, write_pairs
from bsg_data.checks.dataset import check_dataset
from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.manifest import MANIFEST
from bsg_data.dataset.shards import read_scene_graphs
from bsg_data.observation.masked_buildings import stream_masked
from fuzz.parquet_table import shrink, to_document, write_document
from fuzz.target import Target, encode, parse

_ROOMS = ('1,1,"chair",0', '2,2,"bed",3', '3,3,"lamp",3', '4,4,"zzqx",-1')


@cache
def _sound() -> dict[str, bytes]:
    """Return the files of a sound dataset of three buildings, its tables not packed."""
    with tempfile.TemporaryDirectory() as folder:
        source, out = Path(folder, "hm3d"), Path(folder, "dataset")
        for number in range(3):
            place = source / "train" / f"0000{number}-abcdefghi0{number}"
            place.mkdir(parents=True)
            lines = ("HM3D Semantic Annotations", *_ROOMS[: 4 - number])
            (place / f"abcdefghi0{number}.semantic.txt").write_text("\n".join(lines) + "\n")
        build_dataset(HM3DFolder(source), out)
        split_dataset(out, SplitRecipe(ratios=(0.4, 0.3, 0.3)))
        write_pairs(out, PairsRecipe(draws=1))
        for path in out.rglob("*.parquet"):
            shrink(pq.ParquetFile(path).read(), path)
        files = {
            path.relative_to(out).as_posix(): path for path in out.rglob("*") if path.is_file()
        }
        return _list({name: path.read_bytes() for name, path in sorted(files.items())})


def _list(files: dict[str, bytes]) -> dict[str, bytes]:
    """Return the files with a manifest that has their sizes and hashes, as an attacker would."""
    manifest = json.loads(files[MANIFEST])
    manifest.pop("seal", None)  # as of before there were seals
    for entry in manifest["files"]:
        data = files[entry["path"]]
        entry["bytes"], entry["sha256"] = len(data), hashlib.sha256(data).hexdigest()
        entry["rows"] = _count_rows(data, entry["rows"])
    return {**files, MANIFEST: encode(manifest)}


def _count_rows(data: bytes, otherwise: int) -> int:
    try:
        return int(pq.ParquetFile(pa.BufferReader(data)).metadata.num_rows)
    except (pa.ArrowException, OSError):
        return otherwise


@cache
def _tables() -> tuple[str, ...]:
    return tuple(name for name in _sound() if name.endswith(".parquet"))


@cache
def _schema(name: str) -> pa.Schema:
    return pq.read_schema(pa.BufferReader(_sound()[name]))


def seeds() -> dict[str, bytes]:
    """Return the manifest, and each table as it is behind its number, and as a document."""
    made = {"manifest": encode({"manifest": json.loads(_sound()[MANIFEST])})}
    for number, name in enumerate(_tables()):
        if "1-" in name or name.count("-") > 1:
            continue
        table = pq.read_table(pa.BufferReader(_sound()[name]))
        made[f"{name.replace('/', '-')}.json"] = encode({name: to_document(table)})
        made[name.replace("/", "-")] = bytes([number]) + _sound()[name]
    return made


def read(folder: Path, data: bytes) -> object:
    """Check a sound dataset of which something is replaced, and read all that it holds."""
    files = dict(_sound())
    if data[:1] == b"{":
        for name, document in parse(data).items():
            if name in _tables():
                path = folder / "table"
                write_document(document, path, schema=_schema(name))
                files[name] = path.read_bytes()
            elif name == "manifest":
                files[MANIFEST] = json.dumps(document).encode("utf-8", "surrogatepass")
    elif data:
        files[_tables()[data[0] % len(_tables())]] = data[1:]
    if files[MANIFEST] == _sound()[MANIFEST]:
        files = _list(files)
    return _read_all(_write(files, folder))


def _write(files: dict[str, bytes], folder: Path) -> Path:
    """Write those files of a dataset that are not the sound ones, which lie there once."""
    dataset = folder / "dataset"
    for name, data in files.items():
        path = dataset / name
        if not path.is_file() or path.read_bytes() != data:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)
    return dataset


def _read_all(dataset: Path) -> None:
    check_dataset(dataset)
    held = Dataset.open(dataset)
    for scene in held.scene_ids:
        held.cells(scene), held.others(scene), held.connections(scene), held.surroundings(scene)
    for split in held.splits:
        list(stream_masked(held, split))
    list(read_scene_graphs(dataset))


TARGET = Target(
    name="dataset",
    read=read,
    seeds=seeds,
    words=("PAR1", "format_version", "int8", "double", "string", "binary", "bool", "../x", "pairs"),
    most=24_000,
    examples=10,
)
