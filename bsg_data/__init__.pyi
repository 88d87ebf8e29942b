from .build import build_dataset
from .checks.dataset import check_dataset
from .dataset.dataset import Dataset, read_cells, read_splits
from .dataset.histograms import to_histograms
from .dataset.manifest import read_manifest
from .dataset.shards import read_scene_graphs
from .dataset.splits import split_dataset
from .errors import BSGError, ClassMapError, DatasetError, RecipeError, SourceError
from .exports.export import export_dataset
from .merge import merge_datasets
from .observation.observation import Observation
from .observation.pairs import write_pairs
from .recipes import MaskRecipe, PairsRecipe, SplitRecipe
from .scene.class_map import ClassMap, load_class_map
from .scene.room_label import list_room_labels
from .scene.scene_graph import Edge, Room, SceneGraph, SceneObject
from .scene.surroundings import BUILDING_KINDS, Surroundings
from .sources.catalogue import open_source
from .synthetic.buildings import write_synthetic

__all__ = [
    "BUILDING_KINDS",
    "BSGError",
    "ClassMap",
    "ClassMapError",
    "Dataset",
    "DatasetError",
    "Edge",
    "MaskRecipe",
    "Observation",
    "PairsRecipe",
    "RecipeError",
    "Room",
    "SceneGraph",
    "SceneObject",
    "SourceError",
    "SplitRecipe",
    "Surroundings",
    "build_dataset",
    "check_dataset",
    "export_dataset",
    "list_room_labels",
    "load_class_map",
    "merge_datasets",
    "open_source",
    "read_cells",
    "read_manifest",
    "read_scene_graphs",
    "read_splits",
    "split_dataset",
    "to_histograms",
    "write_pairs",
    "write_synthetic",
]
