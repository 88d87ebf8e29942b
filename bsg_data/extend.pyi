from .build import BuiltPart, Part, build_part, finalise_dataset
from .dataset.manifest import Manifest, UnmappedEntry
from .dataset.statistics import (
    count_classes,
    count_frequencies,
    count_sources,
    measure_coverage,
    plot_frequencies,
    refuse_figure,
)
from .exports.catalogue import EXPORTS, EncodedScene, ExportRow
from .files import write_bytes
from .observation.hidden_share import ShareBelief
from .observation.mask_hash import hash_splits
from .observation.masks import MASKS, Mask
from .observation.view import View
from .registry import Registry
from .scene.class_map import published_maps
from .scene.class_space import ClassSpace
from .scene.connections import Connections
from .scene.scene_graph import Box, MeshCoverage
from .scene.surroundings import KNOWN_SOURCES
from .sources.assembly import assemble
from .sources.catalogue import SOURCES
from .sources.hm3d import HM3DFolder
from .sources.room_layouts import WithLayouts
from .sources.source import FoundScenes, Reading, SceneRef, SkippedScene, Source, SourceRow, Terms
from .synthetic.building import BuildingSize
from .synthetic.buildings import GeometryOptions
from .testing import ExportContract, MaskContract, SourceContract

__all__ = [
    "EXPORTS",
    "KNOWN_SOURCES",
    "MASKS",
    "SOURCES",
    "Box",
    "BuildingSize",
    "BuiltPart",
    "ClassSpace",
    "Connections",
    "EncodedScene",
    "ExportContract",
    "ExportRow",
    "FoundScenes",
    "GeometryOptions",
    "HM3DFolder",
    "Manifest",
    "Mask",
    "MaskContract",
    "MeshCoverage",
    "Part",
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
    "assemble",
    "build_part",
    "count_classes",
    "count_frequencies",
    "count_sources",
    "finalise_dataset",
    "hash_splits",
    "measure_coverage",
    "plot_frequencies",
    "published_maps",
    "refuse_figure",
    "write_bytes",
]
