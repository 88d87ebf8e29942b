"""The package of docs/extending.md, installed beside the project: every command takes its rows."""

from __future__ import annotations

import json
import re
import shlex
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result
from conftest import REPOSITORY
from example_packages import installed, read_project

from bsg_cli.registry import COMMANDS
from bsg_data import registry
from bsg_data.dataset.manifest import CARD, CROISSANT

TEXT = (REPOSITORY / "docs" / "extending.md").read_text("utf-8")
BLOCKS = dict(re.findall(r"```python\n# (\S+)\n(.*?)```", TEXT, re.DOTALL))
PROJECT = read_project(TEXT.split("```toml\n")[1].split("```")[0])
ROOMS = ("stove, sink, chair, chair, kitchen cabinet", "bed, pillow, lamp", "toilet, sink, towel")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The folder of the document's package, which is installed for the tests of this file."""
    folder = tmp_path_factory.mktemp("site")
    for name, text in BLOCKS.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, "utf-8")
    (folder / "my_rooms" / "__init__.py").touch()
    with installed(PROJECT, folder, folder):
        yield folder


def run(line: str) -> Result:
    name, *words = shlex.split(line)
    result = CliRunner().invoke(COMMANDS[name], words)
    assert result.exit_code == 0, f"{line}: {result.output}{result.exception!r}"
    return result


@pytest.fixture(scope="module")
def work(site: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dataset of the source, with pairs of the mask, and a run of the model."""
    folder = tmp_path_factory.mktemp("work")
    (folder / "lists").mkdir()
    for k in range(12):
        rooms = [ROOMS[i % 3] for i in range(2 + k % 4)]
        (folder / "lists" / f"house {k:02}.txt").write_text("\n".join([*rooms, ""]), "utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        run("bsg-data build --source room-lists lists --out dataset --workers 1")
        run("bsg-data split dataset")
        run("bsg-data pairs dataset --mask coin --draws 2 --workers 1")
        run("bsg-train dataset --config mean-rate --set model.least=0.02 --out run")
    return folder


@pytest.fixture(autouse=True)
def _in_work(work: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(work)


def test_the_source_and_the_mask_make_a_sound_dataset_under_their_own_terms() -> None:
    run("bsg-data check dataset")  # exits with 1 for any fault
    card = Path("dataset", CARD).read_text("utf-8")
    assert "license: cc-by-4.0" in card
    assert "The lists may be shared if their author is named." in card
    assert "Matterport" not in card + Path("dataset", CROISSANT).read_text("utf-8")


@pytest.fixture
def no_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave the figures out, which take most of the time."""
    monkeypatch.setattr("bsg_models.studies.evaluation_report.plot_evaluation", lambda *_, **__: {})
    plot = "bsg_models.studies.leaderboard_report.plot_leaderboard"
    monkeypatch.setattr(plot, lambda *given, **_: given[2].write_bytes(b""))


@pytest.mark.usefixtures("no_figures")
def test_the_model_is_evaluated_with_the_metric() -> None:
    """In every form of the results: the metric has no place of its own, and follows ours."""
    done = run("bsg-evaluate dataset --model run --out evaluation --html page.html")
    report = json.loads(Path("evaluation/evaluation.json").read_text("utf-8"))
    short = Path("page.html").read_text("utf-8").split("</table>")[0]
    for name, label in (("rooms", "total error ↓"), ("building", "total error, building ↓")):
        value = report["metrics"][f"{name}/total_error"]["mean-rate"]["value"]
        (row,) = re.findall(rf"^{label} +(\S+)", done.stdout, re.MULTILINE)
        assert float(row) == pytest.approx(value, rel=0.01)
        assert f">{label}</td>" in short


@pytest.mark.usefixtures("no_figures")
def test_the_leaderboard_takes_the_model_and_the_mask() -> None:
    words = "--folds 3 --draws 1 --workers 1"
    run("bsg-leaderboard dataset --models doubled,mean-rate --masks coin --out board " + words)
    board = json.loads(Path("board/leaderboard.json").read_text("utf-8"))
    assert set(board["masks"]["coin"]) == {"doubled", "mean-rate"}
    assert "mean-rate" in Path("board/leaderboard.html").read_text("utf-8")


def test_the_leaderboard_runs_on_any_executor(monkeypatch: pytest.MonkeyPatch) -> None:
    """The lines of the page, in a thread: a process would not know the package of this test."""

    def one_thread(workers: int, mp_context: object) -> ThreadPoolExecutor:
        return ThreadPoolExecutor(1)

    monkeypatch.setattr("concurrent.futures.ProcessPoolExecutor", one_thread)
    names: dict[str, Any] = {"__name__": "__main__"}
    exec(compile(BLOCKS["board.py"], "board.py", "exec"), names)
    assert set(names["board"].results["coin"]) == {"doubled", "mean-rate"}


def test_beliefs_are_written_in_the_format_and_read() -> None:
    from bsg_robot import read_belief

    scene = json.loads(run("bsg-belief dataset --model run --mask coin --json").stdout)[0]
    run(f"bsg-belief dataset --model run --scene '{scene['scene_id']}' --out belief.json.gz")
    belief = read_belief(Path("belief.json.gz"))
    assert belief.model == "mean-rate"


def test_the_planner_searches_with_the_beliefs_of_the_model() -> None:
    words = "--episodes 2 --workers 1 --worlds star --task single"
    planners = "nearest,farthest,greedy-belief"
    found = run(f"bsg-search dataset --model run --planners {planners} {words} --json")
    savings = json.loads(found.stdout)["standings"][0]["savings"]
    assert savings["farthest"]["saved"]["value"] <= 0 == savings["nearest"]["saved"]["value"]


def test_a_checkpoint_of_a_model_that_is_not_installed_names_it(
    site: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "path", [path for path in sys.path if path != str(site)])
    registry._installed.cache_clear()
    try:
        result = CliRunner().invoke(COMMANDS["bsg-evaluate"], ["dataset", "--model", "run"])
        assert result.exit_code == 1
        assert "'mean-rate'" in result.stderr
        assert "install that; it is from the package 'my_rooms'" in result.stderr
    finally:
        monkeypatch.undo()
        registry._installed.cache_clear()


def contracts() -> dict[str, type]:
    """Return the test classes of the document's last block."""
    names: dict[str, type] = {}
    exec(compile(BLOCKS["test_my_rooms.py"], "test_my_rooms.py", "exec"), names)
    return {name: made for name, made in names.items() if name.startswith("Test")}


CONTRACTS = contracts()
CASES = [(c, t) for c, made in CONTRACTS.items() for t in dir(made) if t.startswith("test_")]


@pytest.mark.parametrize(("contract", "case"), CASES)
def test_the_package_keeps_the_contracts(contract: str, case: str, tmp_path: Path) -> None:
    proof = getattr(CONTRACTS[contract](), case)
    proof(tmp_path) if "tmp_path" in proof.__annotations__ else proof()


def test_the_document_names_every_seam() -> None:
    assert {name.rpartition("/")[2] for name in BLOCKS if "/" in name} == {
        "source.py",
        "mask.py",
        "model.py",
        "planner.py",
        "metric.py",
        "format.py",
        "export.py",
    }
    groups = set(PROJECT["entry-points"])
    assert groups == set(re.findall(r"\| `(bsg_\w+\.\w+)` \|", TEXT))
    for line in re.findall(r"^bsg-.*$", TEXT, re.MULTILINE):
        name, *words = shlex.split(line)
        help_text = CliRunner().invoke(COMMANDS[name], [*words, "--help"]).output
        for option in (word for word in words if word.startswith("--")):
            assert option in help_text, f"{line}: {option} is no option"
