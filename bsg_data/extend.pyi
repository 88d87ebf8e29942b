from .dataset.manifest import Manifest, SkippedScene
from .dataset.statistics import (
    count_classes,
    count_sources,
    measure_coverage,
    plot_frequencies,
)
from .exports.catalogue import EncodedScene, ExportRow
from .files import write_bytes
from .inputs.bounded_file import hash_file
from .observation.mask_hash import hash_splits
from .observation.masks import MASKS, Layout, Mask
from .observation.pairs import sample_pairs
from .observation.view import View
from .places import refuse_file
from .registry import Registry
from .scene.class_map import published_maps
from .scene.scene_graph import Box, MeshCoverage
from .sources.assembly import assemble
from .sources.catalogue import SOURCES
from .sources.room_layouts import WithLayouts
from .sources.room_words import WithRoomLabels
from .sources.source import (
    AnnotatedRoom,
    Annotation,
    FoundScenes,
    Reading,
    SceneRef,
    Source,
    SourceRow,
)
from .terms import Terms
from .testing import MaskContract, SourceContract

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
