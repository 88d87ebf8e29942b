"""Write a network as an ONNX file, which programs in other languages ask without Python.

The file answers for one building at a time, as the network does for certain hidden shares, with its
calibration. docs/robot-software.md says its inputs, outputs and metadata. Torch's own
exporter writes it, from the functions by which the network answers and trains.
"""

from __future__ import annotations

import logging
import warnings
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import onnxscript  # noqa: F401 - by which torch exports: a missing one is named before any work
import torch
from torch import nn

from bsg_data.arrays import Bools
from bsg_data.errors import RecipeError
from bsg_data.files import AnyPath, encode_json
from bsg_data.places import refuse_file
from bsg_data.results import was_stopped, write_files
from bsg_data.scene.class_map import ClassMap
from bsg_data.scene.room_label import list_room_labels
from bsg_data.scene.surroundings import BUILDING_KINDS, KNOWN_SOURCES
from bsg_models.inputs.nodes import EVIDENCE, Neighbours, Nodes, encode_area, mark
from bsg_models.runs.checkpoint import load_checkpoint, restore_model
from bsg_models.runs.found_model import find_model
from bsg_models.runs.predictor import choose_class_map
from bsg_models.zoo.building_tilt import tilt
from bsg_models.zoo.networks import CountNetwork, to_distribution

_NODES = 5  # of the building that the exporter follows through the network; others have any number
_OF_BUILDING = ("building_kind", "source")


def export_onnx(model: AnyPath, path: AnyPath, *, force: bool = False) -> Path:
    """Write a trained network to a file, and its metadata beside it as JSON.

    Args:
        model: path of a run, or a name, as `find_model` takes it.
        path: of the file, `.onnx`.
        force: replace both, if they exist.

    Raises:
        CheckpointError: if there is no such model.
        RecipeError: if it is no network of hidden counts, or reads which rooms connect; or the name
            of the file does not end in `.onnx`.

    Returns:
        the path of the metadata: that of the file, with the suffix `.json`.
    """
    found, path = find_model(model), Path(path)
    beside = path.with_suffix(".json")
    if path.suffix != ".onnx":
        raise RecipeError(f"{path}: expected the name of an ONNX file, such as universal.onnx")
    left = was_stopped([path, beside])
    for file in (path, beside):
        refuse_file(file, force=force or left)
    checkpoint = load_checkpoint(found.path)
    header = checkpoint.header
    network = restore_model(found.path, checkpoint)
    if not isinstance(network, CountNetwork) or "adjacent" in network.inputs.edges:
        raise RecipeError(
            f"{found.name}: expected a network of hidden counts whose rooms see each other, such "
            "as universal; models that count, and ensembles with them, answer in Python alone",
            code="model-not-exportable",
            where=found.name,
        )
    inputs, nodes = _make_inputs(network), torch.export.Dim("nodes", min=3)
    with _said_nothing():
        program: Any = torch.onnx.export(
            _OneBuilding(network, ~np.isin(header.class_space.classes, header.untaught)).eval(),
            tuple(inputs.values()),
            input_names=list(inputs),
            output_names=["expected", "presence"],
            dynamic_shapes={
                name: {0: nodes} if name not in _OF_BUILDING else {} for name in inputs
            },
            dynamo=True,
            verbose=False,
        )
    metadata = {
        "format": "bsg-network",
        "name": found.name,
        "classes": header.class_space.classes,
        "class_space": str(header.class_space),
        "vocabulary": header.vocabulary,
        "words": _list_words(choose_class_map(found.path, header), network.vocabulary),
        "labels": list_room_labels(),
        "building_kinds": BUILDING_KINDS,
        "sources": KNOWN_SOURCES,
    }
    program.model.metadata_props.update(
        {key: encode_json(value) for key, value in metadata.items()}
        | {"checkpoint": header.model_dump_json()}
    )
    with write_files([path, beside], force=force, left=left) as staged:
        program.save(staged[path])
        staged[beside].write_text(encode_json(metadata, indent=1) + "\n", "utf-8")
    return beside


def _list_words(class_map: ClassMap, vocabulary: Collection[str]) -> dict[str, str]:
    """Return what the words of a class map mean: a class, or a word of the vocabulary."""
    known = {name: class_map.classify(name) for name in sorted(class_map.words)}
    return {
        name: str(meaning.category)
        if meaning.class_index is None
        else class_map.classes[meaning.class_index]
        for name, meaning in known.items()
        if meaning.class_index is not None or meaning.category in vocabulary
    }


@contextmanager
def _said_nothing() -> Iterator[None]:
    """Keep torch's exporter from warning of what it calls itself, and of libraries it may use."""
    log = logging.getLogger("torch.onnx")
    level = log.level
    log.setLevel(logging.ERROR)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        log.setLevel(level)


def _make_inputs(network: CountNetwork) -> dict[str, torch.Tensor]:
    """Return the inputs of the file, of one building with N − 1 rooms, for the exporter to follow.

    They are the arguments of `_OneBuilding.forward`.
    """
    classes, words = network.inputs.classes, len(network.vocabulary)
    return {
        "seen": torch.ones(_NODES, classes),  # objects that were seen
        "others": torch.ones(_NODES, words),  # seen objects of the vocabulary, outside the classes
        "hidden_share": torch.full((_NODES,), 0.5),
        "visited": torch.ones(_NODES),  # 1 or 0
        "withheld": torch.zeros(_NODES, classes),  # 1 or 0
        "floor_area": torch.ones(_NODES),  # m², 0 if unknown
        "labels": torch.zeros(_NODES, len(list_room_labels())),  # P(label), all 0 if unknown
        "building_kind": torch.tensor([-1]),  # place in `BUILDING_KINDS`, −1 if unknown
        "source": torch.tensor([-1]),  # place in `KNOWN_SOURCES`, −1 if unknown
    }


class _OneBuilding(nn.Module):
    """A network as a function of the inputs of the file."""

    def __init__(self, network: CountNetwork, taught: Bools) -> None:
        super().__init__()
        self._network, self._taught = network, torch.from_numpy(taught)
        self._line = torch.from_numpy(network.building_calibration)[:, :, None]
        self._weights = {name: torch.from_numpy(array) for name, array in network.weights.items()}

    def forward(
        self,
        seen: torch.Tensor,
        others: torch.Tensor,
        hidden_share: torch.Tensor,
        visited: torch.Tensor,
        withheld: torch.Tensor,
        floor_area: torch.Tensor,
        labels: torch.Tensor,
        building_kind: torch.Tensor,
        source: torch.Tensor,
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Return the expected hidden counts, and P(at least one), each `[N, C]`."""
        share = torch.where(withheld > 0, 1.0, hidden_share[:, None])
        building = torch.zeros_like(hidden_share, dtype=torch.int64)
        first, is_building = building[:1], torch.arange(seen.shape[0]) == 0
        evidence = {
            "size": encode_area(floor_area),
            "labels": labels,
            "kind": mark(building_kind - 1, EVIDENCE["kind"].width())[building],
            "source": mark(source - 1, EVIDENCE["source"].width())[building],
        }
        nodes = Nodes(
            x=seen,
            y=seen[:0],
            hiding=building[:0],
            neighbours=self._weigh_neighbours(building, first, is_building),
            building=building,
            first=first,
            is_building=is_building,
            visited=visited > 0,
            hidden_share=hidden_share,
            share=share,
            unclassified=others,
            evidence={
                name: evidence[name] for name in EVIDENCE if name in self._network.config.reads
            },
        )
        learned = to_distribution(self._network.forward(self._weights, nodes))
        counts = self._network.calibrate(learned, share)  # type: ignore[arg-type]
        share_of_tilt = torch.ones_like(hidden_share[:1])
        if self._network.reads_labels:
            unlabelled = ((labels[1:].sum(dim=1) == 0) * 1.0).mean()
            share_of_tilt = torch.where(source < 0, unlabelled, 1.0)
        rooms = torch.as_tensor(counts.presence) * ~is_building[:, None]
        tilts, log_none, factors = tilt(rooms, building, seen[:1] > 0, self._line, share_of_tilt)
        likelier: Any = torch.where(share > 0, factors, 0.0)
        counts = counts.with_none_likelier(likelier)
        mean = torch.as_tensor(counts.mean)[1:] * self._taught
        presence = torch.as_tensor(counts.presence)[1:] * self._taught
        some = -torch.expm1(log_none)
        whole = (
            mean.sum(dim=0, keepdim=True),
            some / (some + torch.exp(log_none + tilts)) * self._taught,
        )
        return torch.cat([whole[0], mean]).float(), torch.cat([whole[1], presence]).float()

    def _weigh_neighbours(
        self, building: torch.Tensor, first: torch.Tensor, is_building: torch.Tensor
    ) -> Neighbours:
        """Return which nodes of the building hear of which, without doors."""
        return Neighbours.weigh(
            building=building,
            first=first,
            is_building=is_building,
            rooms=building + (building.shape[0] - 1),
            pairs=torch.zeros((2, 0), dtype=torch.int64),
            edges=self._network.inputs.edges,
        )
