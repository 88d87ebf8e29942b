from __future__ import annotations

import json
from pathlib import Path

import pytest
import yaml
from conftest import BEDROOM, KITCHEN, annotation_text, write_scene
from refusals import refuses

from bsg_data.build import build_dataset
from bsg_data.checks.dataset import check_dataset
from bsg_data.dataset.dataset import Dataset, read_splits
from bsg_data.dataset.manifest import read_manifest
from bsg_data.dataset.shards import read_scene_graphs
from bsg_data.dataset.splits import split_dataset
from bsg_data.dataset.statistics import count_sources
from bsg_data.errors import DatasetError, MismatchError, RecipeError
from bsg_data.merge import merge_datasets
from bsg_data.recipes import SplitRecipe
from bsg_data.sources.catalogue import open_source
from bsg_data.sources.hm3d import HM3DFolder
from bsg_data.synthetic.buildings import write_synthetic


@pytest.fixture(scope="module")
def synthetic(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Ten synthetic buildings as a dataset: only read it."""
    folder = tmp_path_factory.mktemp("synthetic")
    list(write_synthetic(folder / "made", scenes=10, seed=3))
    build_dataset(HM3DFolder(folder / "made"), folder / "synthetic", scenes_per_shard=20)
    return folder / "synthetic"


def test_a_merge_holds_the_buildings_of_both_in_order(
    dataset: Path, synthetic: Path, tmp_path: Path
) -> None:
    merged = merge_datasets([dataset, synthetic], tmp_path / "both")
    parts = {
        graph.scene_id: graph for one in (dataset, synthetic) for graph in read_scene_graphs(one)
    }
    graphs = list(read_scene_graphs(tmp_path / "both"))
    assert [graph.scene_id for graph in graphs] == sorted(parts)
    assert all(graph == parts[graph.scene_id] for graph in graphs)
    assert {source.kind for source in merged.sources} == {"hm3d", "synthetic"}
    assert merged.split is None
    # 12 buildings in shards of 5 and 10 in shards of 20: the larger ones hold all
    assert [file.rows for file in merged.files_of("scenes")] == [20, 2]
    assert check_dataset(tmp_path / "both") == ()
    card = (tmp_path / "both" / "README.md").read_text("utf-8")
    front = yaml.safe_load(card.split("---")[1])
    assert set(front["license"]) == {"other", "apache-2.0"}
    croissant = json.loads((tmp_path / "both" / "croissant.json").read_text("utf-8"))
    assert len(croissant["license"]) == 2
    hm3d, other = count_sources(Dataset.open(tmp_path / "both"))
    assert (hm3d["buildings"], other["buildings"]) == (12, 10)
    assert hm3d["unmapped"] == 66, "bedrooms with a thing that the map does not know"
    assert hm3d["objects"] + other["objects"] == merged.totals.objects


def test_the_order_of_the_parts_and_a_stopped_merge_do_not_matter(
    dataset: Path, synthetic: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    merge_datasets([dataset, synthetic], tmp_path / "first")

    def stop(done: int, total: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        merge_datasets([synthetic, dataset], tmp_path / "second", progress=stop)
    assert not (tmp_path / "second").exists()
    merge_datasets([synthetic, dataset], tmp_path / "second")
    first, second = (read_manifest(tmp_path / name) for name in ("first", "second"))
    assert first == second


def test_each_source_has_its_share_of_every_split(
    dataset: Path, synthetic: Path, tmp_path: Path
) -> None:
    out = tmp_path / "both"
    merge_datasets([dataset, synthetic], out)
    split_dataset(out, SplitRecipe())
    assert check_dataset(out) == ()
    source = {graph.scene_id: graph.source for graph in read_scene_graphs(out)}
    sizes = {
        name: [sum(source[s] == kind for s in scenes) for kind in ("hm3d", "synthetic")]
        for name, scenes in read_splits(out).items()
    }
    assert sizes == {"train": [10, 8], "val": [1, 1], "test": [1, 1]}
    split_dataset(out, SplitRecipe(method="folds", folds=4, ratios=None), force=True)
    for kind in ("hm3d", "synthetic"):
        folds = [sum(source[s] == kind for s in scenes) for scenes in read_splits(out).values()]
        assert max(folds) - min(folds) <= 1


def test_a_building_that_two_datasets_hold_is_refused(dataset: Path, tmp_path: Path) -> None:
    """An id and a key are one name: splits and masks are by id, duplicates by key."""
    for name in ("00903-abcdefghi03", "00950-abcdefghi03", "abcdefghi03"):
        (tmp_path / "objects.csv").write_text(f"scene,room,category\n{name},hall,bed\n")
        source = open_source("table", tmp_path / "objects.csv")
        if name != "abcdefghi03":
            write_scene(tmp_path / name, name, annotation_text({0: KITCHEN, 1: BEDROOM}))
            source = HM3DFolder(tmp_path / name)
        build_dataset(source, tmp_path / "other", force=True)
        with refuses(DatasetError, "building-twice"):  # which is first: by hash
            merge_datasets([dataset, tmp_path / "other"], tmp_path / "both")
    with refuses(DatasetError, "building-twice"):
        merge_datasets([dataset, dataset], tmp_path / "both")
    with refuses(RecipeError, "too-few-datasets"):
        merge_datasets([dataset], tmp_path / "both")
    assert not (tmp_path / "both").exists()


def test_two_class_spaces_do_not_merge(dataset: Path, tmp_path: Path) -> None:
    (tmp_path / "own.csv").write_text("raw_category,category,class\nbed,bed,bed\n", "utf-8")
    (tmp_path / "own.classes.csv").write_text("index,class,definition\n0,bed,A bed.\n", "utf-8")
    write_scene(tmp_path / "more", "00900-zzzzzzzzzzz", annotation_text({0: BEDROOM}))
    build_dataset(
        HM3DFolder(tmp_path / "more"), tmp_path / "o", class_map=str(tmp_path / "own.csv")
    )
    with pytest.raises(MismatchError, match=r"own \(sha256"):
        merge_datasets([dataset, tmp_path / "o"], tmp_path / "both")
