"""Any commands in any order, killed or not, against a model of what must be there.

The model is a clean build: whatever happened before, a dataset that is there has the bytes that the
same commands write in an empty folder, and a command that is run again gets through.
"""

from __future__ import annotations

import hashlib
import os
import random
import shutil
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import pytest
from conftest import BEDROOM, KITCHEN, annotation_text, write_scene
from hypothesis import HealthCheck, note, settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    precondition,
    rule,
    run_state_machine_as_test,
)
from killed_process import Ended, snapshot, start, wait_for
from one_building import read_pairs

from bsg_data.build import build_dataset
from bsg_data.checks.dataset import check_dataset
from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.manifest import read_manifest
from bsg_data.dataset.splits import split_dataset
from bsg_data.errors import DatasetError
from bsg_data.exports.export import export_dataset
from bsg_data.merge import merge_datasets
from bsg_data.observation.pairs import write_pairs
from bsg_data.recipes import MaskRecipe, PairsRecipe, SplitRecipe
from bsg_data.seal import write_seal
from bsg_data.sources.hm3d import HM3DFolder
from bsg_data.synthetic.buildings import write_synthetic
from bsg_models.studies.comparison import EvaluationRequest
from bsg_models.studies.evaluation_report import report_evaluation
from bsg_models.studies.leaderboard import LeaderboardRecipe, make_leaderboard
from bsg_models.studies.leaderboard_report import report_leaderboard
from bsg_models.studies.search_report import report_search
from bsg_models.studies.search_request import SearchRequest
from bsg_models.training.training import train_run
from bsg_models.zoo.config import find_config, override, validate_config
from bsg_robot.answers.belief_report import BeliefRequest, report_beliefs
from bsg_robot.answers.seen_building import open_graph
from bsg_robot.graph.formats import write_belief
from bsg_robot.graph.graph_file import open_graph_file

pytestmark = pytest.mark.heavy

BUILDINGS = range(8)
FOLDS = SplitRecipe(method="folds", ratios=None, folds=3)
HIDDEN = (".build", ".staged")  # what a killed command may leave in a dataset
PARTIAL, ASIDE = "dataset.partial", ".dataset.replaced"
Kill = int | None


@dataclass(frozen=True)
class Made:
    """All that the bytes of a dataset depend on."""

    buildings: frozenset[int]
    seed: int | None = None  # of its split
    draws: int | None = None  # of its pairs
    merged: bool = False  # with another dataset


class Reference:
    """Datasets made without any trouble, each once."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._made: dict[Made, Path] = {}

    def __getitem__(self, made: Made) -> Path:
        if made not in self._made:
            out = self.folder / str(len(self._made)) / "dataset"
            self._made[made] = self._make(made, out)
        return self._made[made]

    def _make(self, made: Made, out: Path) -> Path:
        if made.draws is not None:
            shutil.copytree(self[replace(made, draws=None)], out)
            write_pairs(out, pairs_recipe(made.draws))
        elif made.seed is not None:
            shutil.copytree(self[replace(made, seed=None)], out)
            split_dataset(out, SplitRecipe(ratios=(0.6, 0.2, 0.2), seed=made.seed))
        elif made.merged:
            merge_datasets([self[replace(made, merged=False)], self.other()], out)
        else:
            source = HM3DFolder(write_buildings(out.parent / "hm3d", made.buildings))
            build_dataset(source, out, scenes_per_shard=2)
        return out

    def other(self) -> Path:
        """Return a dataset of other buildings."""
        return self[Made(frozenset({90, 91}))]


def write_buildings(root: Path, numbers: frozenset[int] | range) -> Path:
    for number in numbers:
        rooms = {0: KITCHEN, 1: BEDROOM * (number % 3), -1: ["book"]}
        write_scene(root, f"{number:05d}-abcdefghi{number:02d}", annotation_text(rooms))
    return root


def pairs_recipe(draws: int) -> PairsRecipe:
    return PairsRecipe(mask=MaskRecipe(strategy="rooms"), draws=draws)


def hash_files(folder: Path) -> dict[str, str]:
    """Return path → sha256 of a folder's files, without what a killed command may leave."""
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.relative_to(folder).parts[0] not in HIDDEN
    }


class House(RuleBasedStateMachine):
    """A source, and a dataset made of it."""

    reference: Reference  # of all machines

    def __init__(self) -> None:
        super().__init__()
        self.folder = Path(tempfile.mkdtemp(dir=self.reference.folder)).resolve()
        self.source, self.dataset = self.folder / "hm3d", self.folder / "dataset"
        self.buildings: frozenset[int] = frozenset()
        self.made: Made | None = None
        self.growing = False  # a command that makes a dataset was killed, and may go on
        self.torn = False  # a command that changes the dataset was killed, and none came after it

    def teardown(self) -> None:
        shutil.rmtree(self.folder)

    @initialize(numbers=st.sets(st.sampled_from(BUILDINGS), min_size=5))
    def find_buildings(self, numbers: set[int]) -> None:
        self.buildings = frozenset(numbers)
        write_buildings(self.source, self.buildings)

    @rule(number=st.sampled_from(BUILDINGS))
    def change_source(self, number: int) -> None:
        folder = self.source / "train" / f"{number:05d}-abcdefghi{number:02d}"
        if number in self.buildings and len(self.buildings) > 5:
            shutil.rmtree(folder)
            self.buildings -= {number}
        else:
            write_buildings(self.source, frozenset({number}))
            self.buildings |= {number}

    kills = st.one_of(st.none(), st.integers(1, 60))

    @rule(force=st.booleans(), kill=kills)
    def build(self, force: bool, kill: Kill) -> None:
        source = HM3DFolder(self.source)
        self.grow(
            lambda: build_dataset(source, self.dataset, force=force, scenes_per_shard=2),
            Made(self.buildings),
            force=force,
            kill=kill,
        )

    @rule(force=st.booleans(), seed=st.integers(0, 2), kill=kills)
    def split(self, force: bool, seed: int, kill: Kill) -> None:
        recipe = SplitRecipe(ratios=(0.6, 0.2, 0.2), seed=seed)
        made = self.made
        self.change(
            lambda: split_dataset(self.dataset, recipe, force=force),
            None if made is None else replace(made, seed=seed, draws=None),
            refused=made is None or (made.seed is not None and not force),
            kill=kill,
        )

    @rule(force=st.booleans(), draws=st.integers(1, 3), kill=kills)
    def pairs(self, force: bool, draws: int, kill: Kill) -> None:
        made = self.made
        is_split = made is not None and made.seed is not None
        self.change(
            lambda: write_pairs(self.dataset, pairs_recipe(draws), force=force),
            None if made is None else replace(made, draws=draws),
            refused=not is_split or (made is not None and made.draws is not None and not force),
            kill=kill,
        )

    @rule(force=st.booleans(), kill=kills)
    def merge(self, force: bool, kill: Kill) -> None:
        plain = Made(self.buildings)
        datasets = [self.reference[plain], self.reference.other()]
        self.grow(
            lambda: merge_datasets(datasets, self.dataset, force=force),
            replace(plain, merged=True),
            force=force,
            kill=kill,
        )

    def grow(self, work: Callable[[], object], new: Made, *, force: bool, kill: Kill) -> None:
        """Run a command that makes a dataset; what a killed one left goes with the next."""
        refused = self.made is not None and not force
        self.growing = self.growing and refused
        self.change(work, new, refused=refused, kill=kill)
        if not refused:
            self.growing = any(self.folder.glob(f"*{PARTIAL}*"))

    @precondition(lambda self: self.made is not None and self.made.seed is not None)
    @rule(draws=st.integers(1, 3))
    def read_beside_a_writer(self, draws: int) -> None:
        """Whoever reads gets the old, the new, or an error of ours; never a mix."""
        old = self.made
        assert old is not None
        new = replace(old, draws=draws)
        allowed = {self.tell(self.reference[one]) for one in (old, new)}
        recipe = pairs_recipe(draws)
        process = start(
            lambda: write_pairs(self.dataset, recipe, force=True), inside=self.folder, kill_at=None
        )
        while os.waitid(os.P_PID, process[0], os.WEXITED | os.WNOHANG | os.WNOWAIT) is None:
            try:
                assert self.tell(self.dataset) in allowed
            except DatasetError as error:
                note(f"a reader was told: {error}")
        ended = wait_for(*process)
        assert ended.how == "done", ended
        self.torn, self.made = False, new

    def tell(self, dataset: Path) -> tuple[object, ...]:
        """Return what a reader learns of a dataset."""
        data = Dataset.open(dataset)
        cells = tuple(int(data.cells(scene).sum()) for scene in data.scene_ids)
        splits = data.require_splits()
        rows = [len(read_pairs(data, split)) for split in splits if data.manifest.pairs is not None]
        return cells, tuple(splits.items()), tuple(rows)

    def change(
        self, work: Callable[[], object], new: Made | None, *, refused: bool, kill: Kill
    ) -> None:
        """Run a command that makes `new`, or must be refused; see that what is there may be."""
        old, torn = self.made, self.torn
        ended = self.run(work, kill=kill)
        if ended.how == "killed" and (self.folder / ASIDE).exists() and not self.dataset.exists():
            assert (self.folder / PARTIAL / "dataset.json").is_file(), "neither old nor new"
            ended, torn = self.run(work, kill=None), True  # killed between two renames
        if ended.how == "killed":
            self.torn, self.made = True, self.recognise([old, new])
            return
        if ended.how == "done":
            self.torn = False
            self.see_that_nothing_is_left()
        finished = ended.how == "done" and torn and old == new  # what a killed one had made
        assert finished or ended.how == ("refused" if refused else "done"), ended
        self.made = old if refused else new

    def see_that_nothing_is_left(self) -> None:
        """Nothing of a killed command is left by one that is done, but a build to go on with."""
        beside = {path.name for path in self.folder.iterdir()} - {"hm3d", "dataset"}
        others = {name for name in beside if not name.startswith((PARTIAL, f".{PARTIAL}.shard-"))}
        assert others == set()
        assert self.growing or beside == set()
        assert not any((self.dataset / name).exists() for name in HIDDEN)

    def run(self, work: Callable[[], object], *, kill: Kill) -> Ended:
        ended = wait_for(*start(work, inside=self.folder, kill_at=kill))
        note(f"{ended.how}: {ended.message[-2000:]}")
        assert ended.how != "failed", ended.message
        return ended

    def recognise(self, candidates: list[Made | None]) -> Made | None:
        """Return which of several datasets is there after a kill."""
        if not (self.dataset / "dataset.json").is_file():
            assert None in candidates, "the dataset is gone"
            return None
        # Its manifest counts: a new file that is not listed yet, or a card, may lie there already.
        there = (self.dataset / "dataset.json").read_bytes()
        for made in candidates:
            if made is not None and (self.reference[made] / "dataset.json").read_bytes() == there:
                return made
        raise AssertionError("the manifest is none that these commands write")

    @invariant()
    def is_what_it_must_be(self) -> None:
        if self.made is None:
            assert not (self.dataset / "dataset.json").exists()
            return
        expected, found = hash_files(self.reference[self.made]), hash_files(self.dataset)
        listed = {entry.path for entry in read_manifest(self.dataset).files} | {"dataset.json"}
        assert {path: found.get(path) for path in listed} == {
            path: expected[path] for path in listed
        }

    @precondition(lambda self: self.made is not None)
    @rule()
    def check(self) -> None:
        """Nothing is wrong, whatever a killed command left."""
        assert check_dataset(self.dataset) == ()


@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
def test_any_commands_in_any_order(tmp_path_factory: pytest.TempPathFactory, full: bool) -> None:
    House.reference = Reference(tmp_path_factory.mktemp("state-machine"))
    run_state_machine_as_test(
        House,
        settings=settings(
            max_examples=150 if full else 6,
            stateful_step_count=30 if full else 10,
            suppress_health_check=list(HealthCheck),
            derandomize=not full,
            print_blob=False,
        ),
    )


# Every command that writes, killed at each of its changes of a file, twice


def evaluate(work: Path, *, force: bool = False) -> None:
    """A folder of results, a page, and predictions elsewhere."""
    report_evaluation(
        EvaluationRequest(
            dataset=work / "dataset",
            runs=(work / "run",),
            out=work / "run" / "evaluation",
            html=work / "page.html",
            write_predictions=work / "predictions",
            resamples=2,
            force=force,
        )
    )


def search(work: Path) -> None:
    """A folder of results with a replay."""
    request = SearchRequest.read(
        work / "dataset",
        runs=(work / "run",),
        out=work / "search",
        trace="auto",
        planners=("nearest", "expected-cost"),
        worlds=("star",),
        episodes=2,
        resamples=2,
    )
    report_search(request)


def train(work: Path, *, force: bool = False) -> None:
    """A network, over a run with an evaluation by force."""
    small = ["model.width=4", "model.depth=1", "training.epochs=2", "training.validate_every=1"]
    tables = override(find_config("ceci").model_dump(mode="json"), small)
    config = validate_config(tables, source="test")
    train_run(config, work / "dataset", work / ("run" if force else "new"), force=force)


def rank(work: Path) -> None:
    """A leaderboard: trainings, and a report among them."""
    models = {"gamma-poisson": find_config("gamma-poisson")}
    recipe = LeaderboardRecipe(masks=("uniform",), folds=3, draws=1, resamples=2)
    board = make_leaderboard(work / "dataset", work / "board", models, recipe)
    report_leaderboard(board, work / "board")


def believe(work: Path) -> None:
    """Several files of one graph."""
    (work / "home.json").write_text('{"kitchen": ["stove"], "hall": []}')
    out = tuple(work / name for name in ("a.json", "a.html", "b.json"))
    graphs = (open_graph_file(work / "home.json"),)
    report_beliefs(BeliefRequest(run=work / "run", graphs=graphs, out=out))


def save_memory(work: Path) -> None:
    """What a home has taught, over what was saved before."""
    home = {"kitchen": ["mug"], "hall": []}
    for day in range(3):
        seen = open_graph(work / "home.json") if day else open_graph(home)
        seen.passes(24)
        seen.saw("hall" if day % 2 else "kitchen", "mug", object_id="1")
        write_belief(seen.belief(), work / "home.json")


# Command → the part of its kills that is tried, and its work in a folder with a dataset and a run.
COMMANDS: dict[str, tuple[int, Callable[[Path], object]]] = {
    "build": (1, lambda at: build_dataset(HM3DFolder(at / "hm3d"), at / "new", scenes_per_shard=5)),
    "build --force": (
        1,
        lambda at: build_dataset(HM3DFolder(at / "hm3d"), at / "dataset", force=True),
    ),
    "split --force": (1, lambda at: split_dataset(at / "dataset", FOLDS, force=True)),
    "pairs --force": (1, lambda at: write_pairs(at / "dataset", pairs_recipe(2), force=True)),
    "merge": (1, lambda at: merge_datasets([at / "dataset", at / "other"], at / "new")),
    "synth": (1, lambda at: list(write_synthetic(at / "new", scenes=2, seed=1))),
    "export": (1, lambda at: export_dataset(at / "dataset", at / "new", to="graphml")),
    "belief": (1, believe),
    "memory": (1, save_memory),
    "evaluate": (3, evaluate),
    "evaluate --force": (3, lambda at: evaluate(at, force=True)),
    "search": (8, search),
    "train": (3, train),
    "train --force": (3, lambda at: train(at, force=True)),
    "leaderboard": (8, rank),
}
TIMED = ("training.json", "metrics.csv", "SHA256SUMS", "leaderboard.json")


@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
@pytest.mark.parametrize("command", COMMANDS)
def test_killed_twice_it_leaves_what_an_unbroken_one_leaves(
    command: str,
    dataset: Path,
    run: Path,
    hm3d_folder: Path,
    tmp_path: Path,
    stride: int,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A second kill comes anywhere in the command that repeats the first."""
    monkeypatch.setattr("bsg_models.studies.evaluation_report.plot_evaluation", lambda *_, **__: {})
    slow, work = COMMANDS[command]
    rng = random.Random(command)
    given, out = (tmp_path / name for name in ("given", "out"))
    given.mkdir()
    for folder in (dataset, run, hm3d_folder):
        folder.rename(given / folder.name)
    if command == "merge":
        list(write_synthetic(tmp_path / "others", scenes=1, seed=1))
        build_dataset(HM3DFolder(tmp_path / "others"), given / "other")
    if "--force" in command:
        (given / "run" / "evaluation").mkdir()
        (given / "run" / "evaluation" / "evaluation.json").write_text("{}")
        write_seal(given / "run" / "evaluation", ["evaluation.json"])
    shutil.copytree(given, out)
    work(out)
    whole, at, how = files_of(out), 1, ""
    while how != "done":
        shutil.rmtree(out)
        shutil.copytree(given, out)
        how = wait_for(*start(lambda: work(out), inside=out, kill_at=at)).how
        for kill in (rng.randrange(1, 40), None):
            before = files_of(out)
            again = wait_for(*start(lambda: work(out), inside=out, kill_at=kill))
            # Where nothing but a lock was left to be removed, it was done.
            finished = again.how == "refused" and before == whole
            assert finished or again.how in ("done", "killed"), (at, kill, again)
        assert files_of(out) == whole, (at, set(files_of(out)) ^ set(whole))
        at += 1 if stride == 1 else stride * slow
    assert at > 1


def files_of(folder: Path) -> dict[str, bytes | None]:
    """Return the files below a folder, but for locks that nobody holds, and without times."""
    return {
        name: b"" if name.endswith(TIMED) else data
        for name, data in snapshot(folder).items()
        if not name.endswith(".lock") and data is not None
    }
