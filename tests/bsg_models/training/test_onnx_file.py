"""Exported networks answer as the library does: in onnxruntime, and in Node by the example."""

from __future__ import annotations

import json
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from configurations import configure
from conftest import REPOSITORY
from one_building import observe_building, surround_rooms

from bsg_data.dataset.dataset import Dataset
from bsg_data.errors import RecipeError
from bsg_data.observation.observation import Observation
from bsg_models.inputs.graphs import read_split
from bsg_models.runs.checkpoint import load_checkpoint, restore_model
from bsg_models.runs.checkpoint_file import BEST
from bsg_models.runs.predictor import Predictor
from bsg_models.training.training import train_run
from bsg_models.zoo.catalogue import ZOO
from bsg_models.zoo.features import NetworkConfig
from bsg_robot.graph.graph_file import read_graph
from bsg_robot.graph.reports import reclassify

pytest.importorskip("onnxscript", reason="the extra `onnx` is not installed")
runtime = pytest.importorskip("onnxruntime", reason="onnxruntime is not installed")
NETWORKS = [name for name in ZOO if isinstance(ZOO[name].config, NetworkConfig)]


def feed(seen: Observation) -> dict[str, npt.NDArray[Any]]:
    """Return what a file is asked with."""
    around = seen.surroundings
    arrays = {
        "seen": seen.inputs,
        "others": seen.unclassified,
        "hidden_share": seen.hidden_share,
        "visited": seen.visited,
        "withheld": seen.withheld,
        "floor_area": np.nan_to_num(around.floor_area),
        "labels": around.labels,
    }
    numbers = {"building_kind": around.building_kinds, "source": around.sources}
    return {
        **{name: values.astype(np.float32) for name, values in arrays.items()},
        **{name: values.astype(np.int64) for name, values in numbers.items()},
    }


def ask(path: Path, seen: Observation) -> list[npt.NDArray[np.float32]]:
    """Return what a file expects, and its presences."""
    session = runtime.InferenceSession(path, providers=["CPUExecutionProvider"])
    wanted = {tensor.name for tensor in session.get_inputs()}
    given = {name: array for name, array in feed(seen).items() if name in wanted}
    found: list[npt.NDArray[np.float32]] = session.run(["expected", "presence"], given)
    return found


@pytest.mark.heavy
@pytest.mark.parametrize("name", NETWORKS)
def test_a_file_answers_as_its_network(name: str, dataset: Path, tmp_path: Path) -> None:
    """For one room, several, some withheld classes, and all that a robot can say of a building."""
    from bsg_models.training.onnx_file import export_onnx

    small = ("model.width=8", "model.embedding=4", "training.epochs=4", "training.validate_every=2")
    list(train_run(configure(name, *small), dataset, tmp_path / "run"))
    path = tmp_path / "run" / BEST
    model = restore_model(path, load_checkpoint(path))
    beside = export_onnx(tmp_path / "run", tmp_path / "net.onnx")
    assert json.loads(beside.read_text("utf-8"))["vocabulary"] == list(model.vocabulary)
    seen = read_split(Dataset.open(dataset), "train", vocabulary=model.vocabulary).seen
    around = surround_rooms([12, 30], ["kitchen", None], building_kind="shop", source="mp3d")
    robot = replace(
        observe_building([[3] * 45, [2] * 45, [1] * 45], withheld=[2], surroundings=around),
        vocabulary=model.vocabulary,
        unclassified=np.ones((3, len(model.vocabulary)), dtype=np.int64),
    )
    shares = np.array([0.5, 0.0, 1e-30], dtype=np.float32)  # a searched room hides nothing
    full = replace(robot, inputs=300 * robot.inputs)  # it surely hides more
    every = (
        robot,
        replace(robot, hidden_share=shares),
        full,
        *map(seen.take, ([0], [1], [2])),
    )
    for observed in every:
        expectation = model.expect(observed)
        expected, presence = ask(tmp_path / "net.onnx", observed)
        np.testing.assert_allclose(expected, expectation.hidden, rtol=1e-5, atol=1e-5)
        np.testing.assert_allclose(presence, expectation.presence, atol=1e-5)


def test_a_model_that_counts_is_not_exported_and_none_as_json(tmp_path: Path) -> None:
    """Metadata lie beside the file as JSON."""
    from bsg_models.training.onnx_file import export_onnx

    with pytest.raises(RecipeError):
        export_onnx("universal", tmp_path / "net.json")
    with pytest.raises(RecipeError, match="answer in Python"):
        export_onnx("mixture", tmp_path / "net.onnx")


@pytest.mark.heavy
def test_the_example_asks_from_node(tmp_path: Path) -> None:
    """In JavaScript, of the home of the page, as `Predictor` answers for certain shares."""
    from bsg_models.training.onnx_file import export_onnx

    node, modules = shutil.which("node"), find_modules()
    if node is None or modules is None:
        pytest.skip("node with onnxruntime-web is not installed (npm install -g onnxruntime-web)")
    document = json.loads((REPOSITORY / "docs" / "home.json").read_text("utf-8"))
    for room in document["rooms"]:
        room.setdefault("hidden_share", 0.5 if room.get("visited", True) else 1.0)
    (tmp_path / "certain.json").write_text(json.dumps(document), "utf-8")
    (tmp_path / "node_modules").symlink_to(modules)
    script = tmp_path / "ask_onnx.mjs"
    script.write_bytes((REPOSITORY / "docs" / "examples" / "ask_onnx.mjs").read_bytes())
    files = ("universal.onnx", "universal.json")
    export_onnx("universal", tmp_path / files[0])
    command = [
        node,
        script,
        *(tmp_path / file for file in files),
        REPOSITORY / "docs" / "home.json",
    ]
    done = subprocess.run([*command, "microwave oven"], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    for words, said in ((["gizmo"], "gizmo: not among"), ([], "usage: ")):
        wrong = subprocess.run([*command, *words], capture_output=True, text=True)
        assert (wrong.returncode > 0, wrong.stdout) == (True, "")
        assert wrong.stderr.startswith(said)
    predictor = Predictor("universal")
    graph = reclassify(read_graph(tmp_path / "certain.json"), predictor.class_map)
    column = predictor.classes.index("microwave")
    presence = predictor(graph).presence[1:, column]
    found = json.loads(done.stdout)
    assert list(found) == [room.name for room in graph.rooms]
    np.testing.assert_allclose(list(found.values()), presence, atol=1e-5)


def find_modules() -> Path | None:
    """Return the folder where npm has installed onnxruntime-web for everybody."""
    npm = shutil.which("npm")
    if npm is None:
        return None
    done = subprocess.run([npm, "root", "--global"], capture_output=True, text=True)
    folder = Path(done.stdout.strip())
    return folder if (folder / "onnxruntime-web").is_dir() else None
