"""Write the scenes of a dataset to files in the format of another program."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from bsg_data.dataset.dataset import Dataset
from bsg_data.errors import DatasetError
from bsg_data.exports.catalogue import EXPORTS
from bsg_data.files import AnyPath, resolve_links
from bsg_data.results import write_into
from bsg_data.scene.scene_graph import is_file_name


@dataclass(frozen=True, slots=True)
class Exported:
    """The result of an export."""

    files: int  # number of files
    scenes: int  # number of scenes in them
    rooms: int  # number of rooms in them
    objects: int  # number of objects in them; 0 for a format of rooms alone
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
    row, data = EXPORTS[to], Dataset.open(dataset)
    scenes, number, left_out = data.manifest.totals.scenes, Counter[str](), []
    notes: Counter[str] = Counter()
    with write_into(out, force=force) as staged:
        for done, graph in enumerate(data.read_graphs(), start=1):
            encoded = row.encode(graph, data.manifest.class_space.classes)
            for name, content in encoded.files.items():
                if not is_file_name(name):
                    message = f"scene {graph.scene_id!r}: expected a name of a file, found {name!r}"
                    raise DatasetError(message, code="file-name", where=graph.scene_id)
                (staged / name).write_bytes(content)
            number["files"] += len(encoded.files)
            number["rooms"] += encoded.rooms
            number["objects"] += encoded.objects
            number["rooms_left_out"] += len(graph.rooms) - encoded.rooms
            if not encoded.files:
                left_out.append(graph.scene_id)
            elif encoded.note:
                notes[encoded.note] += 1
            if progress is not None:
                progress(done, scenes)
        if len(left_out) == scenes:
            raise DatasetError(
                f"{dataset}: found nothing in its {scenes:,} scenes for the export {to!r} "
                f"({row.summary})",
                code="export-empty",
                where=dataset,
            )
    return Exported(
        scenes=scenes - len(left_out), left_out=tuple(left_out), notes=dict(notes), **number
    )
