"""Read split and version from HM3D's names, and choose one of several copies."""

from __future__ import annotations

import re
from collections.abc import Iterable

from bsg_data.scene.scene_graph import split_scene_id
from bsg_data.sources.source import FoundScenes, SceneRef, SkippedScene

_VERSION = re.compile(r"v[0-9]+\.[0-9]+")
# minival is part of val: a building in both is val's. The order decides which copy is kept.
_SPLITS = ("train", "val", "test", "minival", "example")
# HM3D's own numbers: 0-799 train, 800-899 val, 900-999 test.
_FIRST_OF_NEXT = {800: "train", 900: "val", 1000: "test"}


def split_of_folder(folder: str) -> str | None:
    """Read the split from a folder's name: `train`, or `hm3d-minival-semantic-annots-v0.2`.

    >>> split_of_folder("hm3d-minival-semantic-annots-v0.2")
    'minival'
    """
    name = folder.split("-")[1] if folder.startswith("hm3d-") else folder
    return name if name in _SPLITS else None


def split_by_number(scene_id: str) -> str | None:
    """Read the split from the number of a scene; None without one.

    >>> split_by_number("00801-HaxA7YrQdEC")
    'val'
    """
    number, _ = split_scene_id(scene_id)
    if number is None:
        return None
    return next((split for end, split in _FIRST_OF_NEXT.items() if number < end), None)


def version_of(name: str) -> str | None:
    """Read the version from the name of a folder or file.

    >>> version_of("HM3DSem-v0.2.zip")
    'v0.2'
    """
    match = _VERSION.search(name)
    return match[0] if match else None


def keep_one_copy(refs: Iterable[SceneRef]) -> FoundScenes:
    """Keep one copy of every building: numbered first, newest version, then split, then path."""
    kept: dict[str, SceneRef] = {}
    duplicates = []
    for ref in sorted(refs, key=_preference):
        first = kept.setdefault(ref.building, ref)
        if first is not ref:
            same = "the same" if first.fingerprint == ref.fingerprint else "OTHER"
            reason = f"building found before at {first.location} with {same} annotation"
            skip = SkippedScene(scene_id=ref.scene_id, location=ref.location, reason=reason)
            duplicates.append(skip)
    scenes = sorted(kept.values(), key=lambda ref: ref.scene_id)
    return FoundScenes(tuple(scenes), tuple(sorted(duplicates, key=lambda skip: skip.location)))


def _preference(ref: SceneRef) -> tuple[bool, tuple[int, ...], int, str]:
    rank = _SPLITS.index(ref.source_split) if ref.source_split in _SPLITS else len(_SPLITS)
    version = (ref.source_version or "v0.0").removeprefix("v").split(".")
    newest = tuple(-int(number) for number in version)
    return (ref.scene_id == ref.building, newest, rank, ref.location)
