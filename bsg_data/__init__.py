"""Facts: read, map, build, mask, split and store 3D scene graphs. Never imports torch."""

from bsg_data.build import build_dataset
from bsg_data.check import check_dataset
from bsg_data.class_map import ClassMap, list_class_maps, load_class_map
from bsg_data.errors import BSGError
from bsg_data.histograms import read_adjacency, read_cells, to_histograms
from bsg_data.manifest import Manifest, read_manifest
from bsg_data.masks import draw_hidden, draw_visited
from bsg_data.pairs import draw_pairs, read_pairs, write_pairs
from bsg_data.partial_graph import PartialGraph, SeenObject, mask_scene, observe
from bsg_data.recipes import MaskRecipe, PairsRecipe, SplitRecipe
from bsg_data.robot_json import read_robot_graph
from bsg_data.scene_graph import Box, Edge, Room, SceneGraph, SceneObject
from bsg_data.shards import read_scene_graphs, read_table, write_shards
from bsg_data.sources import HM3DFolder, HM3DStatistics, Source
from bsg_data.splits import assign_splits, read_splits, split_dataset

__all__ = [
    "BSGError",
    "Box",
    "ClassMap",
    "Edge",
    "HM3DFolder",
    "HM3DStatistics",
    "Manifest",
    "MaskRecipe",
    "PairsRecipe",
    "PartialGraph",
    "Room",
    "SceneGraph",
    "SceneObject",
    "SeenObject",
    "Source",
    "SplitRecipe",
    "assign_splits",
    "build_dataset",
    "check_dataset",
    "draw_hidden",
    "draw_pairs",
    "draw_visited",
    "list_class_maps",
    "load_class_map",
    "mask_scene",
    "observe",
    "read_adjacency",
    "read_cells",
    "read_manifest",
    "read_pairs",
    "read_robot_graph",
    "read_scene_graphs",
    "read_splits",
    "read_table",
    "split_dataset",
    "to_histograms",
    "write_pairs",
    "write_shards",
]
