"""README, docs, help and code say the same thing."""

from __future__ import annotations

import json
import re
import shlex
import shutil
import sys
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path
from types import ModuleType
from typing import Any

import click
import numpy as np
import pytest
from click.testing import CliRunner
from configurations import configure
from conftest import REPOSITORY, load_script, write_twelve
from one_building import observe_building

from bsg_cli.registry import COMMANDS
from bsg_data.dataset.schema import TABLES
from bsg_data.dataset.splits import split_dataset
from bsg_data.observation.pairs import write_pairs
from bsg_data.recipes import MaskRecipe, PairsRecipe, SplitRecipe
from bsg_models.belief.hidden_share import ShareBelief
from bsg_models.runs.predictor import Predictor
from bsg_models.zoo.model import ModelInputs
from bsg_robot.answers.seen_building import open_graph
from bsg_robot.graph.reports import hide_of_room
from bsg_robot.graph.robot_json import parse_robot_graph, read_robot_graph

DOCS = REPOSITORY / "docs"


def every_command() -> Iterator[tuple[str, click.Command]]:
    def below(name: str, command: click.Command) -> Iterator[tuple[str, click.Command]]:
        yield name, command
        if isinstance(command, click.Group):
            for child, sub in command.commands.items():
                yield from below(f"{name} {child}", sub)

    for name, command in COMMANDS.items():
        yield from below(name, command)


def read_blocks(page: str) -> list[str]:
    """Return the blocks of Python of a page of the docs."""
    return re.findall(r"```python\n(.*?)```", (DOCS / page).read_text("utf-8"), re.DOTALL)


def run_block(page: str, block: str) -> dict[str, Any]:
    """Execute a block of a page; return its names."""
    names: dict[str, Any] = {"__name__": "page"}
    exec(compile(block, f"docs/{page}", "exec"), names)
    return names


def test_every_command_has_help_and_a_place_in_the_docs() -> None:
    """Every line of its examples is accepted by the command's own parser."""
    page = (DOCS / "commands.md").read_text("utf-8")
    for name, command in every_command():
        help_text = command.help or ""
        first = help_text.strip().splitlines()[0]
        assert first.endswith("."), f"{name}: the first line is no sentence: {first!r}"
        assert len(first) <= 80, name
        assert f"## {name}\n" in page, name
        options = [one for one in command.params if isinstance(one, click.Option)]
        assert all(one.help for one in options), f"{name}: an option without help"
        shown = command.get_help(click.Context(command, info_name=name, terminal_width=88))
        lines = re.findall(rf"^\s+{name.split()[0]} .*$", shown.split("Example:")[1], re.MULTILINE)
        assert lines, f"{name}: no runnable example"
        for line in re.findall(r"^\s+(bsg-\S+ .*)$", help_text, re.MULTILINE):
            words = shlex.split(line)
            result = CliRunner().invoke(COMMANDS[words[0]], [*words[1:], "--help"])
            assert result.exit_code == 0, f"{line}: {result.output}"
            for option in (word for word in words if word.startswith("--")):
                assert option in result.output, f"{line}: {option} is not an option"


def test_generated_parts_are_current(tmp_path: Path) -> None:
    """Also the columns of all tables: docs/format.md has them as generated parts."""
    scripted = load_script("write_docs")
    pages = {path: path.read_text("utf-8") for path in scripted.find_documents()}
    old = [path.name for path, text in pages.items() if scripted.renew(text) != text]
    scripted.make_demo(tmp_path / "demo.html")
    if (tmp_path / "demo.html").read_bytes() != (REPOSITORY / scripted.DEMO).read_bytes():
        old.append(scripted.DEMO)
    assert old == [], "run `make docs`"
    text = pages[DOCS / "format.md"]
    assert all(f"<!-- generated: columns {name} -->" in text for name in (*TABLES, "splits"))


def test_links_between_documents_lead_somewhere() -> None:
    for path in load_script("write_docs").find_documents():
        for target in re.findall(r"\]\((?!https?:)([^)#]+)", path.read_text("utf-8")):
            assert (path.parent / target).exists(), f"{path.name} links to {target}"


def test_the_ten_lines_run_and_print_what_they_say(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(REPOSITORY)
    text = (REPOSITORY / "README.md").read_text("utf-8")
    block = text.split("<!-- ten lines -->\n```python\n")[1].split("```")[0]
    assert len([line for line in block.splitlines() if line]) <= 10
    exec(compile(block, "README.md", "exec"), {"__name__": "asking"})
    assert capsys.readouterr().out.splitlines() == re.findall(r"# → (.*)", block)


def test_the_map_without_names_of_the_readme_is_answered() -> None:
    text = (REPOSITORY / "README.md").read_text("utf-8")
    ((said, words, room),) = re.findall(
        r"^echo '(.*)' \| bsg-belief (.*?)  # go first to (.*)$", text, re.MULTILINE
    )
    done = CliRunner().invoke(COMMANDS["bsg-belief"], shlex.split(words), input=said)
    assert done.exit_code == 0, done.output
    assert f"\ngo first to {room}\n" in done.stdout


FASTER = {  # a process for each core takes seconds to begin
    "build": "--workers 1",
    "pairs": "--workers 1",
    "bsg-train": "--set training.epochs=3",
    "bsg-search": "--episodes 4 --workers 1",
}


def test_the_first_door_leads_from_annotations_to_a_trained_model(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each command of README, on synthetic buildings in HM3D's layout; then its lines of pandas."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("bsg_models.studies.evaluation_report.plot_evaluation", lambda *_, **__: {})
    write_twelve(tmp_path / "hm3d")
    text = (REPOSITORY / "README.md").read_text("utf-8").split("<!-- first door -->")[1]
    commands, pandas = re.findall(r"```(?:sh|python)\n(.*?)```", text, re.DOTALL)[:2]
    assert len(commands.splitlines()) <= 10
    for line in commands.splitlines():
        name, *words = (
            word.replace("/data/hm3d", "hm3d") for word in shlex.split(line, comments=True)
        )
        if name != "pip":
            faster = FASTER.get(name) or FASTER.get(words[0], "")
            done = CliRunner().invoke(COMMANDS[name], [*words, *faster.split()])
            assert done.exit_code == 0, done.output
    found: dict[str, Any] = {}
    exec(compile(pandas, "README.md", "exec"), found)
    assert {"scene_id", "category", "class"} <= set(found["objects"].columns)
    assert {"input", "target"} <= set(found["pairs"].columns)
    assert Path("report.html").is_file()
    assert Path("belief.html").is_file()


def test_the_robots_of_the_page_go_where_it_says(capsys: pytest.CaptureFixture[str]) -> None:
    """A comment `# → a → b` says what a line prints, one time after the other."""
    block = "".join(read_blocks("robot.md"))
    run_block("robot.md", block)
    said = [one for line in re.findall(r"# → (.*)", block) for one in line.split(" → ")]
    assert capsys.readouterr().out.splitlines() == said


def test_the_examples_of_a_graph_of_hydra_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The commands and the lines of docs/belief.md, beside docs/dsg.json."""
    monkeypatch.chdir(tmp_path)
    shutil.copy(DOCS / "dsg.json", tmp_path)
    part = (DOCS / "belief.md").read_text("utf-8").split("\n## Hydra\n")[1].split("\n## ")[0]
    (block,) = re.findall(r"```python\n(.*?)```", part, re.DOTALL)
    run_block("belief.md", block)
    first = Path("annotated.dsg.json").read_bytes()
    lines = re.findall(r"^(bsg-belief .*--out .*)$", part, re.MULTILINE)
    for line in (f"{line} --force" for line in lines):
        name, *words = shlex.split(line)
        result = CliRunner().invoke(COMMANDS[name], words)
        assert result.exit_code == 0, f"{line}: {result.output}"
    assert len(lines) == 1
    assert Path("annotated.dsg.json").read_bytes() != first, "one of them says more of R(2)"


@pytest.mark.usefixtures("run")
def test_the_examples_beside_an_office_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The very lines of docs/search.md and of docs/hidden-share.md."""
    monkeypatch.chdir(tmp_path)
    shutil.copy(DOCS / "office.json", tmp_path)
    for page in ("search.md", "hidden-share.md"):
        run_block(page, read_blocks(page)[-1])
    room, belief, *presences = capsys.readouterr().out.split("\n")
    assert (room, belief) == ("2", "54% ± 19%")
    weighed, told = map(float, filter(None, presences))
    assert 0 < told < weighed < 1


def test_a_layer_of_the_papers_network_is_changed_as_the_page_says() -> None:
    found = run_block("models.md", read_blocks("models.md")[0])
    model = found["MODEL"].make(found["MODEL"].config, ModelInputs(classes=2)).eval()
    assert [type(one).__name__ for one in model.convolutions] == ["GraphConv"] * 5
    seen = observe_building([[4, 2], [3, 0], [1, 2]])
    assert model.expect(seen).expected.shape == (3, 2)


@pytest.mark.usefixtures("run")
def test_the_example_of_asking_a_model_runs(dataset: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The very lines of docs/models.md, beside a folder `dataset` and a run."""
    monkeypatch.chdir(dataset.parent)
    block = read_blocks("models.md")[1]
    assert run_block("models.md", block)["expectation"].presence.shape[1] == 45


def test_the_losses_are_shown_in_tensorboard(
    dataset: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By a writer that stands in for torch's, which needs one more package."""
    told: list[tuple[str, float, int]] = []

    class SummaryWriter(nullcontext[Any]):
        def __enter__(self) -> Any:
            return self

        def add_scalar(self, *what: Any) -> None:
            told.append(what)

    stand_in = ModuleType("tensorboard")
    stand_in.SummaryWriter = SummaryWriter  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "torch.utils.tensorboard", stand_in)
    small = configure("universal", "training.epochs=3", "training.validate_every=2")
    monkeypatch.setattr("bsg_models.find_config", lambda name: small)
    monkeypatch.chdir(dataset.parent)
    run_block("models.md", read_blocks("models.md")[2])
    names = [(name, epoch) for name, _, epoch in told]
    assert names == [
        ("loss/train", 1),
        *[(f"loss/{one}", epoch) for epoch in (2, 3) for one in ("train", "val")],
    ]


# Both are what mlcroissant uses of other libraries.
@pytest.mark.filterwarnings("ignore:ConjunctiveGraph is deprecated:DeprecationWarning")
@pytest.mark.filterwarnings("ignore:The inplace keyword in DataFrame:DeprecationWarning")
def test_loading_examples_run(dataset: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The very lines of docs/loading.md, in order, beside a folder `dataset`."""
    monkeypatch.chdir(dataset.parent)
    monkeypatch.setenv("HF_HOME", str(dataset.parent / "hf"))
    blocks = read_blocks("loading.md")
    assert len(blocks) >= 12
    for block in blocks:
        run_block("loading.md", block)


def test_the_entry_of_the_benchmark_is_measured(
    dataset: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The very lines of docs/evaluation.md, and the command that measures what they write."""
    split_dataset(dataset, SplitRecipe(method="folds", ratios=None, folds=5), force=True)
    write_pairs(dataset, PairsRecipe(mask=MaskRecipe(strategy="explore"), draws=1))
    monkeypatch.setattr("bsg_models.studies.evaluation_report.plot_evaluation", lambda *_, **__: {})
    monkeypatch.chdir(dataset.parent)
    (block,) = read_blocks("evaluation.md")
    run_block("evaluation.md", block)
    words = ["dataset", "--predictions", "mine.parquet", "--json"]
    result = CliRunner().invoke(COMMANDS["bsg-evaluate"], [*words, "--html", "page.html"])
    assert result.exit_code == 0, result.output
    report = json.loads((dataset.parent / "mine-evaluation" / "evaluation.json").read_text("utf-8"))
    assert report == json.loads(result.stdout)
    assert report["metrics"]["rooms/presence_brier/all"]["mine"]["nodes"] == 12 * 2 + 66
    assert "Look into a building" not in (dataset.parent / "page.html").read_text("utf-8")


def rows_of(page: str, table: str) -> list[list[str]]:
    """Return the cells of the table that a comment names on a page of the docs."""
    text = (DOCS / page).read_text("utf-8").split(f"<!-- {table} -->\n")[1].split("\n\n")[0]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in text.split("\n")[2:]]


def test_the_page_says_what_share_is_estimated() -> None:
    rows = rows_of("hidden-share.md", "situations")
    assert len(rows) >= 10
    for _, said, mean, sd in rows:
        room = {"id": "room", **json.loads("{" + said.strip("`") + "}")}
        graph = parse_robot_graph({"scene_id": "home", "rooms": [room]}, path=Path("page"))
        assert graph.rooms[0].share.mean == pytest.approx(float(mean), abs=0.005), said
        assert graph.rooms[0].share.sd == pytest.approx(float(sd), abs=0.005), said


def test_the_page_says_what_a_model_believes_of_a_share() -> None:
    office, predictor = read_robot_graph(DOCS / "office.json"), Predictor()
    columns = [predictor.classes.index(name) for name in ("sink", "stove", "microwave")]
    for said, *shown in rows_of("hidden-share.md", "kitchen"):
        mean, _, sd = said.removeprefix("anything: ").partition(" ± ")
        share = ShareBelief(float(mean), float(sd or 0))
        presence = predictor(hide_of_room(office, 2, share)).presence[2, columns]
        assert [f"{100 * p:.0f}" for p in presence] == shown, said


def test_the_three_rooms_of_the_paper_are_answered_as_the_page_says() -> None:
    (row,) = (
        line
        for line in (DOCS / "belief.md").read_text("utf-8").splitlines()
        if line.startswith("| ours |")
    )
    seen = open_graph(DOCS / "office.json")
    unseen = [
        [f"{one.name} {100 * one.probability:.0f} %" for one in seen.expected(room) if not one.seen]
        for room in seen.rooms
    ]
    assert row == f"| ours | {' | '.join(', '.join(one[:3]) for one in unseen)} |"


def test_the_shares_of_the_three_rooms_are_those_of_the_page() -> None:
    page = (DOCS / "belief.md").read_text("utf-8").splitlines()
    (row,) = (line for line in page if line.startswith("| ours, as shares |"))
    shown = [cell.strip() for cell in row.strip("|").split("|")][1:]
    predictor = Predictor()
    belief = predictor(read_robot_graph(DOCS / "office.json"))
    for room, said in enumerate(shown, 1):
        shares = belief.expected[room] / belief.expected[room].sum()
        unseen = [c for c in np.argsort(-shares) if belief.inputs[room, c] == 0]
        ours = [f"{predictor.classes[c]} {100 * shares[c]:.0f} %" for c in unseen[:3]]
        assert said == ", ".join(ours)
