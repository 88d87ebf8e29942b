from .build import BuiltPart, Part, build_dataset, build_part, finalise_dataset
from .checks.dataset import check_dataset
from .checks.faults import Fault
from .dataset.categories import OtherObjects
from .dataset.composition import count_sources
from .dataset.coverage import Coverage, count_classes, measure_coverage
from .dataset.dataset import Dataset, read_cells
from .dataset.frequencies import count_frequencies, plot_frequencies, refuse_figure
from .dataset.histograms import to_histograms
from .dataset.manifest import (
    ClassMapEntry,
    ClassSpaceEntry,
    FileEntry,
    Manifest,
    UnmappedEntry,
    read_manifest,
)
from .dataset.shards import read_scene_graphs, read_table, write_shards
from .dataset.splits import assign_splits, read_splits, split_dataset
from .errors import (
    AnnotationError,
    BSGError,
    ClassMapError,
    DatasetError,
    MismatchError,
    RecipeError,
    SourceChangedError,
    SourceError,
    UnmappedNameError,
)
from .exports.catalogue import EXPORTS, ExportRow
from .exports.export import Exported, export_dataset
from .merge import merge_datasets
from .observation.hidden_share import VAGUE, ShareBelief, estimate_hidden_share
from .observation.mask_hash import hash_masks, hash_splits
from .observation.masked_buildings import MaskedBuildings
from .observation.masks import MASKS, Mask, sample_hidden, sample_view, sample_withheld
from .observation.observation import Observation
from .observation.pairs import read_pairs, sample_pairs, write_pairs
from .observation.partial_graph import (
    KnownRoom,
    PartialGraph,
    SeenObject,
    mask_dataset,
    mask_scene,
    observe,
)
from .observation.robot_json import list_unmapped, read_robot_graph
from .observation.view import View
from .recipes import Exploration, MaskRecipe, PairsRecipe, SplitRecipe
from .scene.class_map import (
    Classified,
    ClassMap,
    MapEntry,
    PublishedMap,
    list_class_maps,
    load_class_map,
    published_maps,
)
from .scene.class_space import ClassSpace, list_class_spaces, load_class_space
from .scene.connections import Connections
from .scene.mesh_coverage import MeshCoverage
from .scene.room_label import list_room_labels
from .scene.scene_graph import Box, Edge, Room, SceneGraph, SceneObject
from .scene.surroundings import BUILDING_KINDS, EVIDENCE, KNOWN_SOURCES, Surroundings
from .sources.catalogue import SOURCES, open_source
from .sources.hm3d import HM3DFolder
from .sources.hm3d_stats import HM3DStatistics
from .sources.room_layouts import WithLayouts
from .sources.source import (
    FoundScenes,
    Reading,
    SceneRef,
    SkippedScene,
    Source,
    SourceRow,
    Terms,
)
from .synthetic.building_size import BuildingSize
from .synthetic.buildings import write_synthetic
from .synthetic.geometry import GeometryOptions

__all__ = [
    "BUILDING_KINDS",
    "EVIDENCE",
    "EXPORTS",
    "KNOWN_SOURCES",
    "MASKS",
    "SOURCES",
    "VAGUE",
    "AnnotationError",
    "BSGError",
    "Box",
    "BuildingSize",
    "BuiltPart",
    "ClassMap",
    "ClassMapEntry",
    "ClassMapError",
    "ClassSpace",
    "ClassSpaceEntry",
    "Classified",
    "Connections",
    "Coverage",
    "Dataset",
    "DatasetError",
    "Edge",
    "Exploration",
    "ExportRow",
    "Exported",
    "Fault",
    "FileEntry",
    "FoundScenes",
    "GeometryOptions",
    "HM3DFolder",
    "HM3DStatistics",
    "KnownRoom",
    "Manifest",
    "MapEntry",
    "Mask",
    "MaskRecipe",
    "MaskedBuildings",
    "MeshCoverage",
    "MismatchError",
    "Observation",
    "OtherObjects",
    "PairsRecipe",
    "Part",
    "PartialGraph",
    "PublishedMap",
    "Reading",
    "RecipeError",
    "Room",
    "SceneGraph",
    "SceneObject",
    "SceneRef",
    "SeenObject",
    "ShareBelief",
    "SkippedScene",
    "Source",
    "SourceChangedError",
    "SourceError",
    "SourceRow",
    "SplitRecipe",
    "Surroundings",
    "Terms",
    "UnmappedEntry",
    "UnmappedNameError",
    "View",
    "WithLayouts",
    "assign_splits",
    "build_dataset",
    "build_part",
    "check_dataset",
    "count_classes",
    "count_frequencies",
    "count_sources",
    "estimate_hidden_share",
    "export_dataset",
    "finalise_dataset",
    "hash_masks",
    "hash_splits",
    "list_class_maps",
    "list_class_spaces",
    "list_room_labels",
    "list_unmapped",
    "load_class_map",
    "load_class_space",
    "mask_dataset",
    "mask_scene",
    "measure_coverage",
    "merge_datasets",
    "observe",
    "open_source",
    "plot_frequencies",
    "published_maps",
    "read_cells",
    "read_manifest",
    "read_pairs",
    "read_robot_graph",
    "read_scene_graphs",
    "read_splits",
    "read_table",
    "refuse_figure",
    "sample_hidden",
    "sample_pairs",
    "sample_view",
    "sample_withheld",
    "split_dataset",
    "to_histograms",
    "write_pairs",
    "write_shards",
    "write_synthetic",
]
