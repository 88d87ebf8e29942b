"""Facts: read, map, build, mask, split and store 3D scene graphs. Never imports torch."""

from bsg_data.build import build_dataset
from bsg_data.checks.dataset import check_dataset
from bsg_data.dataset.histograms import read_adjacency, read_cells, to_histograms
from bsg_data.dataset.manifest import Manifest, read_manifest
from bsg_data.dataset.shards import read_scene_graphs, read_table, write_shards
from bsg_data.dataset.splits import assign_splits, read_splits, split_dataset
from bsg_data.errors import BSGError
from bsg_data.observation.masks import sample_hidden, sample_visited
from bsg_data.observation.pairs import read_pairs, sample_pairs, write_pairs
from bsg_data.observation.partial_graph import PartialGraph, SeenObject, mask_scene, observe
from bsg_data.observation.robot_json import read_robot_graph
from bsg_data.recipes import MaskRecipe, PairsRecipe, SplitRecipe
from bsg_data.scene.class_map import ClassMap, list_class_maps, load_class_map
from bsg_data.scene.scene_graph import Box, Edge, Room, SceneGraph, SceneObject
from bsg_data.sources.catalogue import open_source
from bsg_data.sources.hm3d import HM3DFolder
from bsg_data.sources.hm3d_stats import HM3DStatistics
from bsg_data.sources.source import (
    FoundScenes,
    Reading,
    SceneRef,
    SkippedScene,
    Source,
    SourceRow,
    Terms,
)

__all__ = [
    "BSGError",
    "Box",
    "ClassMap",
    "Edge",
    "FoundScenes",
    "HM3DFolder",
    "HM3DStatistics",
    "Manifest",
    "MaskRecipe",
    "PairsRecipe",
    "PartialGraph",
    "Reading",
    "Room",
    "SceneGraph",
    "SceneObject",
    "SceneRef",
    "SeenObject",
    "SkippedScene",
    "Source",
    "SourceRow",
    "SplitRecipe",
    "Terms",
    "assign_splits",
    "build_dataset",
    "check_dataset",
    "list_class_maps",
    "load_class_map",
    "mask_scene",
    "observe",
    "open_source",
    "read_adjacency",
    "read_cells",
    "read_manifest",
    "read_pairs",
    "read_robot_graph",
    "read_scene_graphs",
    "read_splits",
    "read_table",
    "sample_hidden",
    "sample_pairs",
    "sample_visited",
    "split_dataset",
    "to_histograms",
    "write_pairs",
    "write_shards",
]
