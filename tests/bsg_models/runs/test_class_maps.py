from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from conftest import write_twelve

from bsg_data import PairsRecipe, SplitRecipe, build_dataset, split_dataset, write_pairs
from bsg_data.scene.class_map import OwnMap, load_class_map
from bsg_data.sources.hm3d import HM3DFolder
from bsg_models.errors import CheckpointError
from bsg_models.runs.checkpoint import CheckpointHeader, read_header
from bsg_models.runs.predictor import Predictor, choose_class_map
from bsg_models.training.training import train_run
from bsg_models.zoo.config import find_config
from bsg_robot.answers.seen_building import open_graph
from bsg_robot.graph.robot_json import read_robot_graph

PATH = Path("run/best.safetensors")
DEFAULT = load_class_map()


def own_map(spellings: str, classes: str | None = None) -> OwnMap:
    return OwnMap(
        name="mine",
        spellings=f"raw_category,category,class\n{spellings}".encode(),
        classes=None if classes is None else f"index,class,definition\n{classes}".encode(),
    )


STUHL = own_map("Stuhl,Stuhl,chair\ntable,table,desk\n")


@pytest.fixture
def own_run(tmp_path: Path) -> Path:
    """A run on one's own classes, moved, after the dataset and the class map are gone."""
    (tmp_path / "mine.csv").write_text("raw_category,category,class\nbed,bed,Möbel\nsink,sink,\n")
    (tmp_path / "mine.classes.csv").write_text("index,class,definition\n0,Möbel,To lie on.\n")
    out = tmp_path / "dataset"
    build_dataset(
        HM3DFolder(write_twelve(tmp_path / "hm3d")), out, class_map=str(tmp_path / "mine.csv")
    )
    (tmp_path / "mine.csv").unlink()
    split_dataset(out, SplitRecipe())
    write_pairs(out, PairsRecipe(draws=2))
    list(train_run(find_config("gamma-poisson"), out, tmp_path / "trained"))
    shutil.rmtree(out)
    (tmp_path / "moved").mkdir()
    return Path(shutil.move(tmp_path / "trained", tmp_path / "moved" / "run"))


def write_graph(path: Path) -> Path:
    names = ("bed", "sink", "zzqx")
    objects = [{"id": str(i), "room": "a", "category": name} for i, name in enumerate(names)]
    graph = {"scene_id": "home", "rooms": [{"id": "a"}], "objects": objects}
    path.write_text(json.dumps({"format": "bsg-partial-graph", "version": 1, **graph}))
    return path


def test_a_run_on_ones_own_map_reads_graphs_by_itself(own_run: Path, tmp_path: Path) -> None:
    predictor = Predictor(own_run)
    assert predictor.classes == ("Möbel",)
    graph = read_robot_graph(write_graph(tmp_path / "g.json"), class_map=predictor.class_map)
    assert [obj.class_index for obj in graph.objects] == [0, None, None]
    assert predictor(graph).presence.shape == (2, 1)
    seen = open_graph(tmp_path / "g.json", model=own_run)
    assert (seen.graph, seen.where("Möbel")[0].probability) == (graph, 1.0)
    assert any(note.startswith("not in the class map, ignored: 'zzqx'") for note in seen.notes)


def header_of(run: Path, *class_maps: str | OwnMap) -> CheckpointHeader:
    return read_header(run / "best.safetensors").model_copy(update={"class_maps": class_maps})


def test_a_model_of_published_maps_reads_what_people_say(run: Path) -> None:
    header = read_header(run / "best.safetensors")
    assert header.class_maps == ("hm3d45-v1",)
    for class_maps in [("hm3d45-v1",), (), ("procthor45-v1", "behavior45-v1")]:
        assert choose_class_map(PATH, header_of(run, *class_maps)) is DEFAULT


def test_ones_own_words_come_first_and_peoples_after_them_where_the_data_had_them(
    run: Path,
) -> None:
    alone = choose_class_map(PATH, header_of(run, STUHL))
    assert alone.classify("refrigerator").role == "unmapped"
    joined = choose_class_map(PATH, header_of(run, "procthor45-v1", STUHL))
    found = [joined.classify(name).class_index for name in ("stuhl", "table", "refrigerator")]
    assert [None if i is None else DEFAULT.classes[i] for i in found] == [
        "chair",
        "desk",
        "refrigerator",
    ]


def test_a_map_into_other_classes_than_the_models_is_refused(run: Path) -> None:
    other = own_map("bed,bed,rest\n", "0,rest,To lie on.\n")
    with pytest.raises(CheckpointError, match=r"predicts classes of hm3d45-v1 .* leads into mine"):
        choose_class_map(PATH, header_of(run, other))
    with pytest.raises(CheckpointError, match="have different class spaces"):
        choose_class_map(PATH, header_of(run, other, STUHL))
