"""Measure how fast the main jobs are beside what people would use instead, and write the tables.

    python scripts/measure/speed.py --hm3d PATH --out docs/results/figures.json
    python scripts/measure/speed.py --only texts training   # prints two rows

Each row compares two ways to do the same work, which take turns in one run on one core; the least
seconds of processor count. Without HM3D's annotations, buildings are synthetic.
"""

from __future__ import annotations

import argparse
import random
import re
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import torch
from results import ResultsTable, write_figures
from torch import nn
from torch.nn.functional import dropout, mse_loss, relu
from torch_geometric.loader import DataLoader
from torch_geometric.nn import GCNConv

from bsg_data.build import build_dataset
from bsg_data.checks.dataset import check_dataset
from bsg_data.dataset.manifest import Totals
from bsg_data.dataset.schema import TABLES
from bsg_data.dataset.splits import split_dataset
from bsg_data.observation.pairs import write_pairs
from bsg_data.recipes import PairsRecipe, SplitRecipe
from bsg_data.scene.class_map import load_class_map
from bsg_data.sources.hm3d import HEADER as HEADER_LINE
from bsg_data.sources.hm3d import HM3DFolder
from bsg_data.synthetic.buildings import write_synthetic
from bsg_data.tables import format_text
from bsg_models import MaskedGraphs, find_config, train_run
from bsg_models.studies.comparison import EvaluationRequest
from bsg_models.studies.evaluation_report import report_evaluation
from bsg_models.zoo.config import override, validate_config
from bsg_models.zoo.model import one_thread
from bsg_robot import open_graph

BUILDINGS = 145  # as many as HM3D's of the train split that are public
EPOCHS = 50
GROWTH = (100, 400, 2000)  # the first is what a command takes to start
ROOMS = (250, 1000)
ENTRIES = (100, 2000)
WORDS = ("chair", "table", "bed", "lamp")
HEADER = ("work", "compared with", "ours", "theirs", "ratio", "target", "met")
READING = (
    "Both times of a row come from the same run and the same work; they are seconds of processor. "
    "With target “≥”, ours must be at least that many times as fast; with “≤”, ours may take at "
    "most that many times as long."
)


class Speed(NamedTuple):
    """The seconds of the same work in two ways, and the target of their ratio.

    `faster` says whether the target is how many times as fast ours should be at least; otherwise it
    is how many times as long ours may take at most.
    """

    what: str
    against: str
    ours: float
    theirs: float
    target: float
    faster: bool = False

    def cells(self) -> tuple[str, ...]:
        """Return the cells of a row under `HEADER`.

        >>> Speed("a step", "an MLP", 0.0021, 0.001, target=2.5).cells()
        ('a step', 'an MLP', '2.1 ms', '1 ms', '2.1 ×', '≤ 2.5 ×', 'met')
        """
        ratio = self.theirs / self.ours if self.faster else self.ours / self.theirs
        met = ratio >= self.target if self.faster else ratio <= self.target
        times = (f"{s:.3g} s" if s >= 1 else f"{1000 * s:.3g} ms" for s in (self.ours, self.theirs))
        target = f"{'≥' if self.faster else '≤'} {self.target:g} ×"
        said = (f"{ratio:.3g} ×", target, "met" if met else "missed")
        if min(self.ours, self.theirs) <= 0:  # of a difference of two times
            said = ("–", target, "lost in noise")
        return self.what, self.against, *times, *said


def time_both(
    ours: Callable[[], object], theirs: Callable[[], object], *, repeats: int = 5
) -> tuple[float, float]:
    """Return the least seconds of processor of each of two calls, which take turns."""
    taken = [(time_call(ours), time_call(theirs)) for _ in range(repeats)]
    return min(one for one, _ in taken), min(other for _, other in taken)


def time_call(call: Callable[[], object]) -> float:
    """Return the seconds of processor that a call takes."""
    began = time.process_time()
    call()
    return time.process_time() - began


# Building and reading


def build(raw: Path, out: Path) -> Totals:
    """Build a dataset anew, and return what it holds."""
    return build_dataset(HM3DFolder(raw), out, force=True).totals


def prepare(dataset: Path) -> None:
    """Split a dataset, and draw its pairs."""
    split_dataset(dataset, SplitRecipe(), force=True)
    write_pairs(dataset, PairsRecipe(draws=1), force=True)


def measure_texts(raw: Path, folder: Path) -> Iterator[Speed]:
    """Yield what a build of annotations takes beside pandas writing the same tables."""
    files = sorted(raw.rglob("*.semantic.txt"))
    build(raw, folder / "dataset")
    words = classify_words(files)
    write_by_pandas(files, words, folder / "pandas")
    for name in TABLES:
        mine = read_tables(folder / "dataset", name)
        assert mine.equals(read_tables(folder / "pandas", name)), name
    ours, theirs = time_both(
        lambda: build(raw, folder / "dataset"),
        lambda: write_by_pandas(files, words, folder / "pandas"),
    )
    what = f"a build of the texts of {len(files)} buildings"
    yield Speed(what, "pandas writing the same tables", ours, theirs, target=2.5)


def read_tables(dataset: Path, name: str) -> pa.Table:
    """Return a table of a dataset without what only a source or a manifest knows."""
    known = ["building", "source", "source_split", "annotation_sha256", "class_map"]
    table = pa.concat_tables(pq.read_table(one) for one in sorted((dataset / name).iterdir()))
    return table.drop_columns([one for one in known if one in table.column_names]).combine_chunks()


def classify_words(files: Sequence[Path]) -> pd.DataFrame:
    """Return what the class map says of every name, as a table that a notebook would load."""
    texts = "".join(file.read_text("utf-8") for file in files)
    names = sorted(set(re.findall(r',"(.*)",', texts)))
    class_map = load_class_map()
    rows = [(name, class_map.classify(name)) for name in names]
    table = pd.DataFrame(
        [(name, one.category, one.class_index, one.role) for name, one in rows],
        columns=["raw_category", "category", "class_index", "role"],
    )
    return table.assign(**{"class": table["class_index"].map(dict(enumerate(class_map.classes)))})


def write_by_pandas(files: Sequence[Path], words: pd.DataFrame, out: Path) -> None:
    """Write the tables of annotations by pandas, as one would in a notebook."""
    lines = ["instance_id", "colour", "raw_category", "region_id"]
    read = partial(pd.read_csv, skiprows=1, header=None, names=lines, keep_default_na=False)
    scenes = pd.DataFrame({"scene_id": [file.parent.name for file in files]})
    objects = pd.concat(
        [read(file, dtype={"colour": str}).assign(scene_id=file.parent.name) for file in files]
    ).sort_values(["scene_id", "instance_id"], ignore_index=True)
    objects = objects.merge(words, how="left", on="raw_category")
    objects["colour"] = objects["colour"].str.upper().str.zfill(6)
    objects["object_index"] = objects.groupby("scene_id").cumcount() + 1
    objects["has_geometry"] = False
    rooms = objects.loc[objects["region_id"] >= 0, ["scene_id", "region_id"]].drop_duplicates()
    rooms = rooms.sort_values(["scene_id", "region_id"], ignore_index=True)
    rooms["footprint"] = None
    rooms["room_index"] = rooms.groupby("scene_id").cumcount() + 1
    objects = objects.merge(rooms, how="left", on=["scene_id", "region_id"])
    objects["room_index"] = objects["room_index"].fillna(0).astype(int)
    edges = pd.concat(
        [
            pd.DataFrame(
                {
                    "scene_id": rooms["scene_id"],
                    "source_index": 0,
                    "target_kind": "room",
                    "target_index": rooms["room_index"],
                }
            ),
            pd.DataFrame(
                {
                    "scene_id": objects["scene_id"],
                    "source_index": objects["room_index"],
                    "target_kind": "object",
                    "target_index": objects["object_index"],
                }
            ),
        ]
    ).sort_values("scene_id", kind="stable", ignore_index=True)
    edges["kind"], edges["method"] = "contains", "annotation"
    edges["source_kind"] = np.where(edges["source_index"] > 0, "room", "building")
    by_scene = objects.groupby("scene_id")
    scenes["num_rooms"] = scenes["scene_id"].map(rooms.groupby("scene_id").size()).fillna(0)
    scenes["num_objects"] = scenes["scene_id"].map(by_scene.size())
    scenes["num_classified"] = scenes["scene_id"].map(by_scene["class_index"].count())
    scenes["has_geometry"] = False
    scenes[["source", "class_map", "annotation_sha256"]] = "hm3d", "", ""
    tables = {"scenes": scenes, "rooms": rooms, "objects": objects, "edges": edges}
    for name, schema in TABLES.items():
        (out / name).mkdir(parents=True, exist_ok=True)
        path, frame = out / name / "part.parquet", tables[name].reindex(columns=schema.names)
        frame.to_parquet(path, schema=schema, compression="zstd", index=False)


def measure_entries(_: Path, folder: Path) -> Iterator[Speed]:
    """Yield what a build of many buildings takes beside one of few, all in one folder."""
    few, many = ENTRIES
    paths = {number: folder / str(number) for number in ENTRIES}
    for number, path in paths.items():
        for building in range(number):
            name = f"example{building:04d}"
            file = path / "raw" / f"{building:05d}-{name}" / f"{name}.semantic.txt"
            file.parent.mkdir(parents=True)
            lines = [f'{i},{i:X},"{word}",{i % 4}' for i, word in enumerate(WORDS * 5, start=1)]
            file.write_text("\n".join([HEADER_LINE, *lines, ""]))
    build(paths[few] / "raw", paths[few] / "dataset")  # imports
    ours, theirs = time_both(
        lambda: build(paths[many] / "raw", paths[many] / "dataset"),
        lambda: [build(paths[few] / "raw", paths[few] / "dataset") for _ in range(many // few)],
        repeats=3,
    )
    what = f"a build of {many:,} buildings in one folder"
    yield Speed(what, f"{many // few} builds of {few}", ours, theirs, target=1.2)


# Training


def measure_training(raw: Path, folder: Path) -> Iterator[Speed]:
    """Yield what a training of the paper's network takes beside a loop in plain PyG.

    Both read the same graphs. Ours also measures the val buildings, and writes a checkpoint.
    """
    build(raw, folder / "dataset")
    prepare(folder / "dataset")
    tables = find_config("paper").model_dump(mode="json")
    config = validate_config(override(tables, [f"training.epochs={EPOCHS}"]), source="paper")
    training, model = config.training, config.model
    graphs = list(MaskedGraphs.stored(folder / "dataset", "train", edges=config.data.edges))
    sizes = [45, *[model.width] * (model.depth - 1), 45]

    def ours() -> None:
        train_run(config, folder / "dataset", folder / "run", force=True)

    def theirs() -> None:
        network = PlainGCN(sizes, model.dropout)
        rate, decay = training.learning_rate, training.decay
        optimiser = torch.optim.Adam(network.parameters(), lr=rate, weight_decay=decay)
        loader = DataLoader(graphs, batch_size=training.batch_size, shuffle=True)
        for batch in (one for _ in range(EPOCHS) for one in loader):
            optimiser.zero_grad()
            mse_loss(network(batch), batch.y).backward()
            optimiser.step()

    taken = time_both(ours, theirs, repeats=3)
    what = f"a training of `ceci`, {EPOCHS} epochs"
    yield Speed(what, "the same network in plain PyG, on the same graphs", *taken, 1.5, True)


class PlainGCN(nn.Module):
    """The paper's network, whose layers normalise themselves."""

    def __init__(self, sizes: Sequence[int], share: float) -> None:
        super().__init__()
        self.convolutions = nn.ModuleList(GCNConv(a, b, improved=True) for a, b in pairwise(sizes))
        self.norms = nn.ModuleList(nn.BatchNorm1d(width) for width in sizes[1:-1])
        self.share = share

    def forward(self, batch: Any) -> torch.Tensor:
        """Return the predicted totals."""
        x, edges = batch.x, (batch.edge_index, batch.x.new_ones(batch.num_edges))
        for convolution, norm in zip(self.convolutions, self.norms, strict=False):
            x = dropout(relu(norm(convolution(x, *edges))), self.share, self.training)
        return self.convolutions[-1](x, *edges)


# As the data grow


def measure_growth(_: Path, folder: Path) -> Iterator[Speed]:
    """Yield what one more building costs among many, and among few."""
    paths = [folder / str(number) for number in GROWTH]
    for path, number in zip(paths, GROWTH, strict=True):
        list(write_synthetic(path / "raw", scenes=number, seed=0))
    jobs: dict[str, Callable[[Path], object]] = {
        "build": lambda path: build(path / "raw", path / "dataset"),
        "split, pairs": lambda path: prepare(path / "dataset"),
        "check": lambda path: check_dataset(path / "dataset"),
        "evaluate": evaluate,
    }
    least, few, many = GROWTH
    for name, run in jobs.items():
        run(paths[0])  # imports
        turns = [[time_call(partial(run, path)) for path in paths] for _ in range(2)]
        start, one, other = map(min, zip(*turns, strict=True))
        ours, theirs = (other - start) / (many - least), (one - start) / (few - least)
        what = f"{name}: one more building of {many:,}"
        yield Speed(what, f"one more of {few:,}", ours, theirs, target=1.1)


def evaluate(path: Path) -> None:
    """Evaluate a shipped model on the test buildings."""
    shutil.rmtree(path / "evaluation", ignore_errors=True)
    out = path / "evaluation"
    report_evaluation(EvaluationRequest(runs=("mixture",), dataset=path / "dataset", out=out))


def measure_decisions(_: Path, __: Path) -> Iterator[Speed]:
    """Yield what a decision takes among many rooms beside one among few."""
    few, many = (open_graph(make_grid(number)) for number in ROOMS)

    def decide(seen: Any) -> None:
        seen.searched("0")  # so that nothing is known already
        assert seen.next_room("microwave", here="0") in seen.rooms

    ours, theirs = time_both(lambda: decide(many), lambda: decide(few))
    what, square = f"where to go, {ROOMS[1]:,} rooms", (ROOMS[1] / ROOMS[0]) ** 2
    yield Speed(what, f"the same, {ROOMS[0]} rooms", ours, theirs, target=square)


def make_grid(rooms: int) -> dict[str, Any]:
    """Return the graph of a robot in a grid of rooms, a third of which connect across."""
    draw, wide = random.Random(0), int(np.ceil(rooms**0.5))
    kinds = ("bedroom", "kitchen", "bathroom", "living room", "hallway", "office", "closet")
    places = [[4 * (n % wide), 4 * (n // wide), 0] for n in range(rooms)]
    said = [
        {"id": str(n), "room_type": draw.choice(kinds), "position": place}
        for n, place in enumerate(places)
    ]
    along = [[str(n), str(n - 1)] for n in range(1, rooms) if n % wide]
    down = [n for n in range(wide, rooms) if n % wide == 0 or draw.random() < 1 / 3]
    ways = along + [[str(n), str(n - wide)] for n in down]
    return {"scene_id": "grid", "rooms": said, "adjacency": ways}


JOBS: Mapping[str, Callable[[Path, Path], Iterator[Speed]]] = {
    "texts": measure_texts,
    "training": measure_training,
    "entries": measure_entries,
    "growth": measure_growth,
    "decisions": measure_decisions,
}
SHOWN = {
    "Beside what you would use instead": ("texts", "training"),
    "As the data grow": ("entries", "growth", "decisions"),
}


def main(argv: Sequence[str] | None = None) -> int:
    """Measure, print the rows, and write the tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--hm3d", type=Path, help="folder with annotations of HM3D")
    parser.add_argument("--out", type=Path, help="JSON of figures")
    parser.add_argument("--only", nargs="+", choices=JOBS, default=list(JOBS))
    options = parser.parse_args(argv)
    rows: dict[str, list[tuple[str, ...]]] = {title: [] for title in SHOWN}
    for job in options.only:
        with tempfile.TemporaryDirectory() as folder, one_thread():
            raw = options.hm3d or Path(folder, "raw")
            if options.hm3d is None:
                list(write_synthetic(raw, scenes=BUILDINGS, seed=0))
            (work := Path(folder, "work")).mkdir()
            found = [one.cells() for one in JOBS[job](raw, work)]
        rows[next(title for title, jobs in SHOWN.items() if job in jobs)] += found
        print(format_text(found, header=HEADER), flush=True)
    if options.out:
        tables = [
            ResultsTable(title, HEADER, rows[title], READING, tested_on="unseen") for title in SHOWN
        ]
        write_figures(options.out, "speed", tables, argv=[__file__, *(argv or sys.argv[1:])])
    return 0


if __name__ == "__main__":
    sys.exit(main())
