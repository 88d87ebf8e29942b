"""Label spaces of robots, YAML and CSV: `bsg_data.sources.label_space`."""

from __future__ import annotations

from pathlib import Path

from bsg_data.sources.label_space import load_label_space
from fuzz.target import Target, put


def seeds() -> dict[str, bytes]:
    """Return a space in Hydra's YAML, and one as CSV."""
    return {
        "hydra": b"label_names:\n- {label: 5, name: chair}\n- {label: 6, name: '7', category: x}\n",
        "csv": b'label,name,category\n5,chair,\n6,"a, b",sofa\n',
    }


def read(folder: Path, data: bytes) -> object:
    """Read a file as YAML, unless it looks like CSV."""
    suffix = ".csv" if b"label," in data[:100] else ".yaml"
    return load_label_space(str(put(folder, suffix, data)))


TARGET = Target(
    name="label-space",
    read=read,
    seeds=seeds,
    words=("label", "name", "category", "4294967296", "&a", "*a", "<<: ", "? ", "'", '"', ".nan"),
    most=200,
)
