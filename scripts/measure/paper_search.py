"""Let the paper's own system search, in all the ways that the paper may be read.

    python scripts/measure/paper_search.py --leaderboard board --readings up@uniform --models \
        ceci@uniform --kept kept --out docs/results/figures.json

A reading is a way to fill what the paper leaves open of its network. The three that save most on
the val buildings of each fold, in the first world, are measured on the test buildings beside
`--models`. Each is asked by the paper's rule and by ours, in every world and task, for three sets
of artifacts. `--kept` has a JSON for each search, so that a stopped script goes on.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from folds import READS, open_dataset, open_folds, say_reads
from results import ResultsTable, format_estimate, write_figures

from bsg_models.evaluation.bootstrap import Estimate
from bsg_models.studies.search_report import report_search
from bsg_models.studies.search_request import ROOM_SPECIFIC, SearchRequest

WORLDS = ("star:1-10", "complete:5-10", "tree:1-10", "layout")
PLANNERS = ("greedy-share", "expected-cost")  # the paper's rule, and ours
TASKS = ("single", "all")
ARTIFACTS = ("every class", "room-specific", "frequent")
STATISTICS = {"saved": "ratio of sums", "mean": "mean of ratios", "median": "median of ratios"}
PAPER = {"single": 33.8, "all": 45.5}
FREQUENT = 10  # classes with most objects
BEST = 3  # readings
EPISODES_OF_VAL = 4


@dataclass(frozen=True, slots=True)
class Search:
    """Searches of all buildings of one kind of split, by one model in one world."""

    model: str
    world: str
    artifacts: str = ARTIFACTS[0]
    split: str = "test"

    @property
    def name(self) -> str:
        """The name of its file, before the number of its episodes."""
        return "_".join(asdict(self).values()).replace(":", "-").replace(" ", "-")


Standings = Mapping[tuple[str, str], Mapping[str, Any]]  # task, planner → what it saves


def search(one: Search, board: Path, kept: Path, *, episodes: int) -> Standings:
    """Return what the planners save; from the kept file, if there is one."""
    episodes = episodes if one.split == "test" else EPISODES_OF_VAL
    file = kept / f"{one.name}_{episodes}.json"
    if not file.exists():
        data = open_dataset(board, one.model)
        with tempfile.TemporaryDirectory() as folder:
            request = SearchRequest.read(
                data.path,
                runs=tuple(fold.run for fold in open_folds(board, one.model)),
                worlds=(one.world,),
                planners=PLANNERS,
                artifacts=_list_artifacts(board, one),
                episodes=episodes,
                split=one.split,
                out=Path(folder) / "search",
            )
            text = json.dumps(report_search(request).summary["standings"])
        kept.mkdir(parents=True, exist_ok=True)
        (kept / f".{file.name}").write_text(text, "utf-8")
        (kept / f".{file.name}").replace(file)
    standings = json.loads(file.read_text("utf-8"))
    return {
        (task["task"], planner): saving
        for task in standings
        for planner, saving in task["savings"].items()
    }


def _list_artifacts(board: Path, one: Search) -> list[str]:
    if one.artifacts == "every class":
        return ["every"]
    if one.artifacts == "room-specific":
        return [*ROOM_SPECIFIC]
    data = open_dataset(board, one.model)
    classes = data.manifest.class_space.classes
    column = data.read_table("objects", columns=["class_index"])
    indices = column["class_index"].drop_null().to_numpy()
    counts = np.bincount(indices, minlength=len(classes))
    return [classes[c] for c in np.argsort(-counts, kind="stable")[:FREQUENT]]


def search_all(searches: Sequence[Search], options: argparse.Namespace) -> dict[Search, Standings]:
    """Return the standings of several searches, made by several processes."""
    with ProcessPoolExecutor(options.workers, mp_context=get_context("spawn")) as pool:
        asked = {
            pool.submit(
                search, one, options.leaderboard, options.kept, episodes=options.episodes
            ): one
            for one in searches
        }
        for done, future in enumerate(as_completed(asked), 1):
            future.result()
            print(f"{done} of {len(asked)}: {asked[future].name}", file=sys.stderr, flush=True)
    return {one: future.result() for future, one in asked.items()}


def choose_readings(options: argparse.Namespace) -> tuple[list[str], ResultsTable]:
    """Return the readings that save most on the val buildings of all folds, and a table.

    A reading counts by the better of the two rules. No model has seen its fold's val buildings in
    training; one choice holds for all folds.
    """
    asked = [Search(name, WORLDS[0], split="val") for name in options.readings]
    found = search_all(asked, options)
    saved = {
        one.model: [100 * of["single", planner]["saved"]["value"] for planner in PLANNERS]
        for one, of in found.items()
    }
    order = sorted(saved, key=lambda name: -max(saved[name]))
    rows = [[f"`{name}`", *(f"{value:.1f}" for value in saved[name])] for name in order]
    reading = f"Cost saved on val buildings, in per cent, in `{WORLDS[0]}`, task `single`."
    header = ("reading", *(f"`{planner}`" for planner in PLANNERS))
    return order[:BEST], ResultsTable("Readings on val", header, rows, reading, tested_on="chosen")


def tabulate_worlds(
    board: Path, models: Sequence[str], found: Mapping[Search, Standings]
) -> ResultsTable:
    """Return what each model saves in each world and task, every class an artifact."""
    rows = []
    for name in models:
        told = say_reads(board, name)
        for planner in PLANNERS:
            for task in TASKS:
                of = [found[Search(name, world)][task, planner]["saved"] for world in WORLDS]
                rows.append([f"`{name}`", f"`{planner}`", told, f"`{task}`", *map(_percent, of)])
    reading = (
        "Cost saved against going to the nearest room, in per cent, with 95 % intervals over "
        "buildings. Below 0, it costs more."
    )
    header = ("belief of", "planner", READS, "task", *(f"`{world}`" for world in WORLDS))
    return ResultsTable("The paper's system", header, rows, reading, tested_on="unseen")


def _percent(saved: Mapping[str, float]) -> str:
    estimate = Estimate(saved["value"], saved["low"], saved["high"], 1)
    return format_estimate(estimate, digits=1, scale=100)


def list_choices(
    models: Sequence[str], found: Mapping[Search, Standings]
) -> Iterator[tuple[tuple[str, ...], float, float]]:
    """Yield every way to measure, and what it saves for `single` and for `all`, per cent."""
    for one, of in found.items():
        if one.model in models:
            for planner in PLANNERS:
                for key, statistic in STATISTICS.items():
                    single, every = (
                        100
                        * (
                            of[task, planner][key]["value"]
                            if key == "saved"
                            else of[task, planner][key]
                        )
                        for task in TASKS
                    )
                    yield (one.model, planner, one.world, one.artifacts, statistic), single, every


def tabulate_choices(
    models: Sequence[str], found: Mapping[Search, Standings]
) -> list[ResultsTable]:
    """Return what each choice moves, and the ways to measure that come nearest to the paper."""
    every = [*list_choices(models, found)]
    rows = []
    for place, name in enumerate(("belief of", "planner", "world", "artifacts", "statistic")):
        for value in dict.fromkeys(choices[place] for choices, _, _ in every):
            saved = np.array([(a, b) for choices, a, b in every if choices[place] == value])
            ends = [
                f"{low:.0f} to {high:.0f}"
                for low, high in zip(saved.min(0), saved.max(0), strict=True)
            ]
            above = f"{(saved[:, 1] > saved[:, 0]).sum()} of {len(saved)}"
            means = [f"{mean:.1f}" for mean in saved.mean(0)]
            rows.append(
                [
                    name,
                    f"`{value}`" if place < 3 else value,
                    means[0],
                    ends[0],
                    means[1],
                    ends[1],
                    above,
                ]
            )
    header = (
        "choice",
        "value",
        "single, mean",
        "range",
        "all, mean",
        "range",
        "`all` above `single`",
    )
    reading = (
        "Cost saved, in per cent, over all other choices. `layout` has 50 buildings, other worlds "
        f"145. Room-specific are {', '.join(ROOM_SPECIFIC)}; frequent are the {FREQUENT} classes "
        "with most objects."
    )
    moves = ResultsTable("What each choice moves", header, rows, reading, tested_on="unseen")
    goal = np.array([PAPER[task] for task in TASKS])
    near = sorted(every, key=lambda one: float(np.abs(np.array(one[1:]) - goal).max()))[:5]
    rows = [
        [*(f"`{c}`" for c in choices[:3]), *choices[3:], f"{a:.1f}", f"{b:.1f}"]
        for choices, a, b in near
    ]
    rows.append(["the paper", "", "", "", "", *(f"{value}" for value in goal)])
    header = ("belief of", "planner", "world", "artifacts", "statistic", "single", "all")
    reading = (
        "The ways to measure whose larger distance from the two figures of the paper is least."
    )
    return [moves, ResultsTable("Nearest to the paper", header, rows, reading, tested_on="unseen")]


def main(argv: Sequence[str] | None = None) -> int:
    """Search, and write the tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--leaderboard", type=Path, required=True, help="folder of bsg-leaderboard")
    parser.add_argument("--readings", nargs="+", required=True, metavar="NAME@MASK")
    parser.add_argument("--models", nargs="+", required=True, metavar="NAME@MASK", help="beside")
    parser.add_argument(
        "--kept", type=Path, required=True, help="folder of finished searches of this leaderboard"
    )
    parser.add_argument("--out", type=Path, required=True, help="JSON of figures")
    parser.add_argument("--episodes", type=int, default=30, help="searches of every building")
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args(argv)
    best, chosen = choose_readings(options)
    models = [*options.models, *(name for name in best if name not in options.models)]
    asked = [Search(*one) for one in _cross(models)]
    found = search_all(asked, options)
    tables = [
        chosen,
        tabulate_worlds(options.leaderboard, models, found),
        *tabulate_choices(models, found),
    ]
    data = open_dataset(options.leaderboard, models[0])
    words = [__file__, *(argv or sys.argv[1:])]
    write_figures(options.out, "paper_search", tables, argv=words, data=data)
    return 0


def _cross(models: Sequence[str]) -> Iterator[tuple[str, str, str]]:
    """Yield model, world and artifacts."""
    for artifacts in ARTIFACTS:
        for world in WORLDS:
            for model in models:
                yield model, world, artifacts


if __name__ == "__main__":
    sys.exit(main())
