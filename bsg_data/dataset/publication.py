"""Publish a dataset: cards first, manifest last; so a manifest means a finished dataset."""

from __future__ import annotations

from pathlib import Path

from bsg_data.dataset.card import write_card, write_croissant
from bsg_data.dataset.kept_maps import list_kept
from bsg_data.dataset.manifest import MANIFEST, Manifest, encode_manifest, seal_manifest
from bsg_data.files import write_bytes

CARD = "README.md"
CROISSANT = "croissant.json"
REPORTS = ".reports"  # of a build under way; gone when it is done
PLAN = f"{REPORTS}/plan.json"  # of a build by parts
REPLACES = f"{REPORTS}/replaces"  # the hash of the manifest of what is to be replaced
RECIPE = f"{REPORTS}/recipe.json"  # the first file of a build
REVISION = ".revision"  # what a command is about to change; gone when it is done


def publish(dataset: Path, manifest: Manifest) -> None:
    """Write the dataset card, the Croissant description and, last, the manifest that seals them."""
    cards = {CARD: write_card(manifest).encode(), CROISSANT: write_croissant(manifest).encode()}
    for name, card in cards.items():
        write_bytes(dataset / name, card)
    write_bytes(dataset / MANIFEST, seal_manifest(encode_manifest(manifest), cards))


def list_strays(dataset: Path, manifest: Manifest) -> list[str]:
    """Return the sorted files in a dataset's folder that the manifest does not list."""
    known = {entry.path for entry in manifest.files} | {MANIFEST, CARD, CROISSANT}
    known |= set(list_kept(manifest))
    return [path for path in list_paths(dataset) if path not in known]


def list_paths(folder: Path, *, below: str = ".") -> list[str]:
    """Return the sorted relative paths of all files below a folder."""
    found = (path for path in (folder / below).rglob("*") if path.is_symlink() or not path.is_dir())
    return sorted(path.relative_to(folder).as_posix() for path in found)
