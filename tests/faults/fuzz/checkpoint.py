"""Checkpoints: `bsg_models.runs.checkpoint`."""

from __future__ import annotations

import hashlib
import json
import math
import struct
from pathlib import Path
from typing import Any

from bsg_data.dataset.manifest import ClassSpaceEntry
from bsg_data.scene.class_space import hash_classes
from bsg_models.runs.checkpoint import CheckpointHeader, load_checkpoint, restore_model
from bsg_models.zoo.config import find_config, override, validate_config
from bsg_models.zoo.construction import make_model
from fuzz.target import NoFileError, Target, encode, parse, put

_CLASSES = ("bed", "chair")
_BYTES = {"F32": 4, "F64": 8, "I64": 8, "U8": 1, "BOOL": 1, "F16": 2, "I32": 4, "BF16": 2}
_KINDS = {"torch.float32": "F32", "torch.float64": "F64", "torch.int64": "I64", "torch.uint8": "U8"}
_KINDS["torch.bool"] = "BOOL"
_MOST = 1 << 18  # bytes of tensors
_MODELS = {
    "gamma-poisson": (),
    "ceci-sage": ("model.width=4", "model.depth=1", "model.embedding=2"),
    "mixture": ("model.types=2",),
    "ensemble": ("model.members=['gamma-poisson']",),
    "conditional": (),
}


def _describe(name: str, settings: tuple[str, ...]) -> dict[str, Any]:
    config = find_config(name)
    if settings:
        tables = override(config.model_dump(mode="json", exclude_none=True), settings)
        config = validate_config(tables, source="a test")
    space = ClassSpaceEntry(name="two", sha256=hash_classes(_CLASSES), classes=_CLASSES)
    header = CheckpointHeader(
        config=config, class_space=space, vocabulary=("lamp",), dataset_sha256="0" * 64
    )
    model = make_model(config, classes=len(_CLASSES), vocabulary=("lamp",))
    tensors = {
        f"model.{key}": [_KINDS[str(value.dtype)], list(value.shape), 0]
        for key, value in model.state_dict().items()
    }
    return {"header": header.model_dump(mode="json"), "tensors": tensors}


def _pack(document: dict[str, Any]) -> bytes:
    """Return the checkpoint that a document says, with hashes that are right."""
    entries: dict[str, Any] = {}
    data, digest = bytearray(), hashlib.sha256()
    names = {kind: name for name, kind in _KINDS.items()}
    try:
        for name, (kind, shape, byte) in sorted(document["tensors"].items()):
            if not all(type(length) is int and 0 <= length <= _MOST for length in shape):
                raise NoFileError("no shape of a tensor")  # as [[1], 10**12], whose product is huge
            size = _BYTES[kind] * math.prod(shape)
            if size > _MOST - len(data):
                raise NoFileError("too much")
            held = bytes([byte & 255]) * size
            entries[name] = {
                "dtype": kind,
                "shape": shape,
                "data_offsets": [len(data), len(data) + size],
            }
            data += held
            digest.update(f"{json.dumps([name, names.get(kind, kind), shape])}\n".encode())
            digest.update(held)
        header = {**document["header"], "tensors_sha256": digest.hexdigest()}
    except (KeyError, TypeError, ValueError, AttributeError, UnicodeEncodeError) as error:
        raise NoFileError(f"no tensors: {error}") from error
    text = json.dumps(header).removesuffix("}")
    seal = hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()
    metadata = {"__metadata__": {"bsg": f'{text},"sha256":"{seal}"}}'}}
    whole = json.dumps({**metadata, **entries}).encode()
    return struct.pack("<Q", len(whole)) + whole + data


def seeds() -> dict[str, bytes]:
    """Return checkpoints of five families as documents, and one as it is."""
    made = {name: _describe(name, settings) for name, settings in _MODELS.items()}
    whole = _pack(made["gamma-poisson"])
    return {"whole": whole, **{name: encode(document) for name, document in made.items()}}


def read(folder: Path, data: bytes) -> object:
    """Read a checkpoint, or the one that a document says, and make its model."""
    packed = _pack(parse(data)) if data[:1] == b"{" else data
    path = put(folder, ".safetensors", packed)
    return restore_model(path, load_checkpoint(path))


TARGET = Target(
    name="checkpoint",
    read=read,
    seeds=seeds,
    words=(
        "__metadata__",
        "data_offsets",
        "F16",
        "BF16",
        "I32",
        "universal",
        "deepsets",
        "ceci-gat",
    ),
    most=9_000,
)
