from .dataset.manifest import Manifest, SkippedScene, Terms, UnmappedEntry
from .dataset.statistics import (
    count_classes,
    count_frequencies,
    count_sources,
    measure_coverage,
    plot_frequencies,
)
from .exports.catalogue import EXPORTS, EncodedScene, ExportRow
from .files import write_bytes
from .observation.hidden_share import ShareBelief
from .observation.mask_hash import hash_splits
from .observation.masks import MASKS, Mask
from .observation.view import View
from .registry import Registry
from .results import refuse_file
from .scene.class_map import published_maps
from .scene.class_space import ClassSpace
from .scene.connections import Connections
from .scene.scene_graph import Box, MeshCoverage
from .scene.surroundings import KNOWN_SOURCES
from .sources.assembly import assemble
from .sources.catalogue import SOURCES
from .sources.hm3d import HM3DFolder
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
from .testing import ExportContract, MaskContract, SourceContract

__all__ = [
    "EXPORTS",
    "KNOWN_SOURCES",
    "MASKS",
    "SOURCES",
    "AnnotatedRoom",
    "Annotation",
    "Box",
    "ClassSpace",
    "Connections",
    "EncodedScene",
    "ExportContract",
    "ExportRow",
    "FoundScenes",
    "HM3DFolder",
    "Manifest",
    "Mask",
    "MaskContract",
    "MeshCoverage",
    "Reading",
    "Registry",
    "SceneRef",
    "ShareBelief",
    "SkippedScene",
    "Source",
    "SourceContract",
    "SourceRow",
    "Terms",
    "UnmappedEntry",
    "View",
    "WithLayouts",
    "WithRoomLabels",
    "assemble",
    "count_classes",
    "count_frequencies",
    "count_sources",
    "hash_splits",
    "measure_coverage",
    "plot_frequencies",
    "published_maps",
    "refuse_file",
    "write_bytes",
]
