"""What sources, masks and exports of others need, and programs that go below the public names."""

from bsg_data.dataset.manifest import Manifest, SkippedScene
from bsg_data.dataset.statistics import (
    count_classes,
    count_sources,
    measure_coverage,
    plot_frequencies,
)
from bsg_data.exports.catalogue import EncodedScene, ExportRow
from bsg_data.files import write_bytes
from bsg_data.inputs.bounded_file import hash_file
from bsg_data.observation.mask_hash import hash_splits
from bsg_data.observation.masks import MASKS, Layout, Mask
from bsg_data.observation.pairs import sample_pairs
from bsg_data.observation.view import View
from bsg_data.places import refuse_file
from bsg_data.registry import Registry
from bsg_data.scene.class_map import published_maps
from bsg_data.scene.scene_graph import Box, MeshCoverage
from bsg_data.sources.assembly import assemble
from bsg_data.sources.catalogue import SOURCES
from bsg_data.sources.room_layouts import WithLayouts
from bsg_data.sources.room_words import WithRoomLabels
from bsg_data.sources.source import (
    AnnotatedRoom,
    Annotation,
    FoundScenes,
    Reading,
    SceneRef,
    Source,
    SourceRow,
)
from bsg_data.terms import Terms
from bsg_data.testing import MaskContract, SourceContract

__all__ = [
    "MASKS",
    "SOURCES",
    "AnnotatedRoom",
    "Annotation",
    "Box",
    "EncodedScene",
    "ExportRow",
    "FoundScenes",
    "Layout",
    "Manifest",
    "Mask",
    "MaskContract",
    "MeshCoverage",
    "Reading",
    "Registry",
    "SceneRef",
    "SkippedScene",
    "Source",
    "SourceContract",
    "SourceRow",
    "Terms",
    "View",
    "WithLayouts",
    "WithRoomLabels",
    "assemble",
    "count_classes",
    "count_sources",
    "hash_file",
    "hash_splits",
    "measure_coverage",
    "plot_frequencies",
    "published_maps",
    "refuse_file",
    "sample_pairs",
    "write_bytes",
]
