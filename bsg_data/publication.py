"""Publish a dataset: cards first, manifest last, so that a manifest means a finished dataset."""

from __future__ import annotations

import shutil
from pathlib import Path

from bsg_data.card import write_card, write_croissant
from bsg_data.errors import DatasetError
from bsg_data.manifest import MANIFEST, Manifest, encode_manifest
from bsg_data.shards import write_bytes

CARD = "README.md"
CROISSANT = "croissant.json"


def publish(dataset: Path, manifest: Manifest) -> None:
    """Write the dataset card, the Croissant description and, last, the manifest."""
    write_bytes(dataset / CARD, write_card(manifest).encode())
    write_bytes(dataset / CROISSANT, write_croissant(manifest).encode())
    write_bytes(dataset / MANIFEST, encode_manifest(manifest))


def withdraw_pairs(dataset: Path, manifest: Manifest) -> Manifest:
    """Take the pairs out of a dataset and return its manifest without them."""
    remaining = manifest.with_table("pairs", (), pairs=None)
    if remaining != manifest:
        publish(dataset, remaining)
    _remove(dataset / "pairs")
    return remaining


def withdraw_split(dataset: Path, manifest: Manifest) -> Manifest:
    """Take the split out of a dataset, and with it the pairs that follow from it."""
    manifest = withdraw_pairs(dataset, manifest)
    remaining = manifest.with_table("splits", (), split=None)
    if remaining != manifest:
        publish(dataset, remaining)
    (dataset / "splits.parquet").unlink(missing_ok=True)
    return remaining


def _remove(folder: Path) -> None:
    try:
        shutil.rmtree(folder)
    except FileNotFoundError:
        return
    except OSError as error:
        raise DatasetError(f"{folder}: cannot be removed ({error.strerror})") from error
