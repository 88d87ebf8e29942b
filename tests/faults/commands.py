"""Every command that writes: what it is given, what it leaves, and what may differ between runs.

What commands are given is made once, in a folder with a subfolder for each of `MAKES`, and copied.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from conftest import REPOSITORY
from fork_server import ForkServer

# Of a dataset that is changed: it is whole in between, without what is to be replaced.
CARDS = tuple(f"dataset/{name}" for name in ("README.md", "croissant.json", "dataset.json"))
RATIOS = "--ratios 0.5 0.25 0.25"
TINY = "--set model.width=8 --set training.epochs=2"


@dataclass(frozen=True, slots=True)
class Command:
    """A command that writes.

    Attributes:
        name: what tests call it.
        line: its command line.
        given: what lies in its folder → what it is a copy of.
        writes: what it leaves in its folder, besides what was there.
        again: what is added to the line to go on after it was killed.
        then: a command that follows it when it is through.
        growing: names of files that are there before the command is through, whole at each time.
        varying: names of files whose bytes differ between two unbroken runs; a seal is then held
            against the files that it lists.
        resumes: whether what it has made so far stays when it is stopped.
        most: trials of one kind in full, where each takes seconds; None for all.
    """

    name: str
    line: str
    given: Mapping[str, str] = field(default_factory=dict)
    writes: tuple[str, ...] = ()
    again: str = ""
    then: str = ""
    growing: tuple[str, ...] = ()
    varying: tuple[str, ...] = ()
    resumes: bool = False
    most: int | None = None

    @property
    def words(self) -> list[str]:
        """Its command line, in words."""
        return self.line.split()

    @property
    def words_again(self) -> list[str]:
        """The command line that goes on after it was stopped."""
        return f"{self.line} {self.again}".split()

    def limit(self, number: int) -> int:
        """Return a number of trials, or fewer where each takes seconds."""
        return number if self.most is None else min(number, self.most)

    def spread(self, sizes: Sequence[int]) -> list[int]:
        """Return sizes, or fewer of them, from the first to the last, where each takes seconds."""
        number = self.limit(len(sizes))
        return [sizes[i * (len(sizes) - 1) // max(number - 1, 1)] for i in range(number)]


COMMANDS = (
    Command(
        "synth",
        "bsg-data synth --out buildings --scenes 4 --workers 1",
        writes=("buildings",),
        growing=("buildings/synthetic.json",),  # which says that it is not finished
        resumes=True,
    ),
    Command(
        "synth --geometry",
        "bsg-data synth --out buildings --scenes 1 --rooms 2 --geometry --workers 1",
        writes=("buildings",),
        growing=("buildings/synthetic.json",),  # which says that it is not finished
        resumes=True,
    ),
    Command(
        "synth --force",
        "bsg-data synth --out buildings --scenes 3 --seed 1 --workers 1 --force",
        {"buildings": "buildings"},
        ("buildings",),
        growing=("buildings/synthetic.json",),  # which says that it is not finished
        resumes=True,
    ),
    Command(
        "build",
        "bsg-data build --hm3d buildings --out dataset --workers 1",
        {"buildings": "buildings"},
        ("dataset",),
        resumes=True,
        most=60,
    ),
    Command(
        "build --workers 2",
        "bsg-data build --hm3d buildings --out dataset --workers 2",
        {"buildings": "buildings"},
        ("dataset",),
        resumes=True,
        most=20,
    ),
    Command(
        "build --force",
        "bsg-data build --hm3d buildings --out dataset --workers 1 --force",
        {"buildings": "others", "dataset": "paired"},
        ("dataset",),
        resumes=True,
        most=60,
    ),
    Command(
        "build --parts",
        "bsg-data build --hm3d buildings --out dataset --workers 1 --parts 1/1",
        {"buildings": "buildings"},
        ("dataset",),
        then="bsg-data finalise dataset",
        resumes=True,
        most=60,
    ),
    Command(
        "finalise",
        "bsg-data finalise dataset",
        {"dataset.partial": "parts"},
        ("dataset",),
        resumes=True,
    ),
    Command(
        "split",
        f"bsg-data split dataset {RATIOS}",
        {"dataset": "built"},
        ("dataset",),
        growing=CARDS,
    ),
    Command(
        "split --force",
        f"bsg-data split dataset {RATIOS} --seed 1 --force",
        {"dataset": "paired"},
        ("dataset",),
        growing=CARDS,
    ),
    Command(
        "pairs",
        "bsg-data pairs dataset --draws 2 --workers 1",
        {"dataset": "split"},
        ("dataset",),
        growing=CARDS,
    ),
    Command(
        "pairs --force",
        "bsg-data pairs dataset --draws 2 --mask rooms --workers 1 --force",
        {"dataset": "paired"},
        ("dataset",),
        growing=CARDS,
    ),
    Command(
        "merge",
        "bsg-data merge one two --out dataset",
        {"one": "built", "two": "other"},
        ("dataset",),
        most=40,
    ),
    Command("upgrade", "bsg-data upgrade dataset", {"dataset": "version-1"}, ("dataset",), most=60),
    Command(
        "export",
        "bsg-data export dataset --to habitat --out regions",
        {"dataset": "with boxes"},
        ("regions",),
    ),
    Command(
        "info --figure",
        "bsg-data info dataset --figure classes.png",
        {"dataset": "built"},
        ("classes.png",),
        most=20,
    ),
    Command(
        "train, counting",
        "bsg-train --config mixture --data dataset --out run --set model.types=2 "
        "--set model.iterations=3",
        {"dataset": "paired"},
        ("run",),
        again="--resume",
        growing=("run/",),
        varying=("run/log.jsonl", "run/SHA256SUMS"),
        resumes=True,
    ),
    Command(
        "train, a network",
        f"bsg-train --config ceci-gcn --data dataset --out run {TINY}",
        {"dataset": "paired"},
        ("run",),
        again="--resume",
        growing=("run/",),
        varying=("run/log.jsonl", "run/metrics.csv", "run/SHA256SUMS"),
        resumes=True,
    ),
    Command(
        "train --force, counting",
        "bsg-train --config train-mean --data dataset --out run --force",
        {"dataset": "paired", "run": "run"},
        ("run",),
        varying=("run/log.jsonl", "run/SHA256SUMS"),
    ),
    Command(
        "train --force, a network",
        f"bsg-train --config ceci-gcn --data dataset --out run {TINY} --force",
        {"dataset": "paired", "run": "run"},
        ("run",),
        again="--resume",
        varying=("run/log.jsonl", "run/metrics.csv", "run/SHA256SUMS"),
        resumes=True,
    ),
    Command(
        "evaluate",
        "bsg-evaluate run --data dataset --resamples 3 --out results --html page.html "
        "--write-predictions predicted",
        {"dataset": "paired", "run": "run"},
        ("results", "page.html", "predicted"),
        most=8,
    ),
    Command(
        "evaluate --predictions",
        "bsg-evaluate --predictions predicted --data dataset --resamples 3 --out results",
        {"dataset": "paired", "predicted": "predicted"},
        ("results",),
        most=8,
    ),
    Command(
        "leaderboard",
        "bsg-leaderboard --data dataset --models doubled,gamma-poisson --masks uniform --folds 3 "
        "--draws 1 --resamples 2 --workers 1 --out board",
        {"dataset": "paired"},
        ("board",),
        growing=("board/",),
        varying=(
            *("log.jsonl", "metrics.csv", "seconds.json", "SHA256SUMS"),
            *("board/leaderboard.json", "board/leaderboard.md"),  # which tell of seconds
        ),
        resumes=True,
        most=10,
    ),
    Command(
        "search",
        "bsg-search --data dataset --run run --worlds star:1-3 --artifacts bed,sink --episodes 2 "
        "--masks 1 --resamples 2 --workers 1 --trace --animation found.gif --out found",
        {"dataset": "paired", "run": "run"},
        ("found", "found.gif"),
        most=8,
    ),
    Command(
        "belief",
        "bsg-belief home.json --run run --out belief.json --html belief.html --tables belief",
        {"home.json": "home.json", "run": "run"},
        ("belief", "belief.html", "belief.json"),
    ),
    Command(
        "belief --hydra",
        "bsg-belief dsg.json --labels mpcat40 --run run --hydra annotated.json",
        {"dsg.json": "dsg.json", "run": "run"},
        ("annotated.json",),
    ),
)


class Given:
    """What commands are given: made when it is first asked for, then copied."""

    def __init__(self, server_of: Callable[[list[str]], ForkServer], folder: Path) -> None:
        self._server_of, self._folder = server_of, folder
        folder.mkdir(parents=True)

    def lay_out(self, command: Command, folder: Path) -> None:
        """Make a folder with what a command is given."""
        folder.mkdir(parents=True)
        for name, what in command.given.items():
            _copy(self._find(what), folder / name)

    def _find(self, what: str) -> Path:
        """Return what there is of a name, made if it is not there."""
        path = self._folder / what
        if not path.exists():
            MAKES[what](self, path)
        return path

    def make(self, path: Path, line: str, **given: str) -> None:
        """Run a command in a folder of its own and keep what it writes to `made`."""
        work = path.with_name(f"{path.name}.work")
        work.mkdir()
        for name, what in given.items():
            _copy(self._find(what), work / name)
        ended = self._server_of(line.split()).run(line.split(), work)
        assert ended.code == 0, ended.said
        (made,) = (entry for entry in work.iterdir() if entry.name.startswith("made"))
        made.rename(path)
        shutil.rmtree(work)


def _make_version_1(given: Given, path: Path) -> None:
    from version_1_files import write_version_1

    from bsg_data.recipes import MaskRecipe

    given.make(path, "bsg-data pairs made --draws 2 --workers 1", made="split")
    write_version_1(path, mask=MaskRecipe())


def _make_dsg(given: Given, path: Path) -> None:
    from dsg_files import write_graph

    write_graph(path)


def _say(line: str, **given: str) -> Callable[[Given, Path], None]:
    return lambda prepared, path: prepared.make(path, line, **given)


_BUILD = "bsg-data build --hm3d buildings --out made --workers 1"
MAKES: dict[str, Callable[[Given, Path], None]] = {
    "buildings": _say("bsg-data synth --out made --scenes 4 --workers 1"),
    "others": _say("bsg-data synth --out made --scenes 3 --seed 1 --workers 1"),
    "built": _say(_BUILD, buildings="buildings"),
    "other": _say(_BUILD, buildings="others"),
    "meshes": _say("bsg-data synth --out made --scenes 2 --rooms 2 --geometry --workers 1"),
    "with boxes": _say(_BUILD, buildings="meshes"),
    "parts": _say(f"{_BUILD} --parts 1/1", buildings="buildings"),
    "split": _say(f"bsg-data split made {RATIOS}", made="built"),
    "paired": _say("bsg-data pairs made --draws 2 --workers 1", made="split"),
    "version-1": _make_version_1,
    "run": _say("bsg-train --config gamma-poisson --data dataset --out made", dataset="paired"),
    "predicted": _say(
        "bsg-evaluate run --data dataset --resamples 0 --out results --write-predictions made",
        run="run",
        dataset="paired",
    ),
    "home.json": lambda given, path: _copy(REPOSITORY / "docs" / "home.json", path),
    "dsg.json": _make_dsg,
}


def _copy(source: Path, target: Path) -> None:
    if source.is_dir():
        shutil.copytree(source, target)
    else:
        shutil.copy(source, target)
