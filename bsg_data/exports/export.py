"""Write the scenes of a dataset to files in the format of another program."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from bsg_data.dataset.manifest import Manifest, read_manifest
from bsg_data.dataset.shards import read_scene_graphs
from bsg_data.errors import DatasetError
from bsg_data.exports.catalogue import EXPORTS, EncodedScene, ExportRow
from bsg_data.files import AnyPath, resolve_links, write_bytes
from bsg_data.results import write_together
from bsg_data.scene.scene_graph import is_scene_id


@dataclass(frozen=True, slots=True)
class Exported:
    """The result of an export."""

    files: int  # number of files
    scenes: int  # number of scenes in them
    rooms: int  # number of rooms in them
    left_out: tuple[str, ...]  # ids of the scenes without content for the format
    rooms_left_out: int  # number of rooms without content for the format, in all scenes
    # note → number of scenes that it applies to
    notes: Mapping[str, int] = field(default_factory=dict)


def export_dataset(
    dataset: AnyPath,
    out: AnyPath,
    *,
    to: str,
    force: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> Exported:
    """Write all scenes of a dataset in another format.

    Every file is complete or absent. All files are written before the first is renamed.

    Args:
        dataset: folder of the dataset.
        out: folder to write to; other files in it stay unchanged.
        to: name of a row of `EXPORTS` or of an installed entry point.
        force: replace existing files.
        progress: called with (scenes done, scenes in all).

    Raises:
        RecipeError: if the export is unknown; the error has the nearest name.
        DatasetError: if the dataset is unreadable, no scene has content for the format, or a file
            exists or cannot be written.
    """
    dataset, out = Path(dataset), resolve_links(out)
    row, manifest = EXPORTS[to], read_manifest(dataset)
    with write_together(out) as growing:
        done = _encode_all(dataset, manifest, growing, row, progress=progress)
        if not done.scenes:
            raise DatasetError(
                f"{dataset}: none of its {manifest.totals.scenes:,} scenes has anything for the "
                f"export {to!r} ({row.summary})",
                code="export-empty",
                where=dataset,
            )
        if not force:
            _refuse_replacing(growing, out)
    return done


def _encode_all(
    dataset: Path,
    manifest: Manifest,
    growing: Path,
    row: ExportRow,
    *,
    progress: Callable[[int, int], None] | None,
) -> Exported:
    files = rooms = rooms_left_out = 0
    left_out: list[str] = []
    notes: Counter[str] = Counter()
    for number, graph in enumerate(read_scene_graphs(dataset, manifest=manifest), start=1):
        encoded = row.encode(graph)
        _write_scene(encoded, growing, graph.scene_id)
        files += len(encoded.files)
        rooms += encoded.rooms
        rooms_left_out += len(graph.rooms) - encoded.rooms
        if not encoded.files:
            left_out.append(graph.scene_id)
        elif encoded.note:
            notes[encoded.note] += 1
        if progress is not None:
            progress(number, manifest.totals.scenes)
    scenes = manifest.totals.scenes - len(left_out)
    return Exported(files, scenes, rooms, tuple(left_out), rooms_left_out, dict(notes))


def _write_scene(encoded: EncodedScene, growing: Path, scene_id: str) -> None:
    for name, data in encoded.files.items():
        if not is_scene_id(name):
            raise DatasetError(
                f"scene {scene_id!r}: {name!r} is no file name", code="file-name", where=scene_id
            )
        write_bytes(growing / name, data)


def _refuse_replacing(growing: Path, out: Path) -> None:
    taken = sorted(file.name for file in growing.iterdir() if (out / file.name).exists())
    if taken:
        more = f" and {len(taken) - 1:,} more" if len(taken) > 1 else ""
        raise DatasetError(
            f"{out / taken[0]}: exists{more}; --force replaces such files",
            code="path-taken",
            where=out / taken[0],
        )
