"""Measure how the cost of a building grows with their number, for pairs, check and evaluate.

    python scripts/bench/speed.py --only growth
    python scripts/bench/growth.py --buildings 1000 100000   # an hour

Buildings are synthetic. A hundred are made, and repeated under other names, because a building
costs the same wherever it comes from.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc
from timing import Speed

from bsg_data.build import build_dataset
from bsg_data.checks.dataset import check_dataset
from bsg_data.dataset.commit import publish
from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.manifest import Totals
from bsg_data.dataset.schema import TABLES
from bsg_data.dataset.shards import write_parquet
from bsg_data.dataset.splits import split_dataset
from bsg_data.observation.pairs import write_pairs
from bsg_data.recipes import PairsRecipe, SplitRecipe
from bsg_data.sources.hm3d import HM3DFolder, split_scene_id
from bsg_data.synthetic.buildings import write_synthetic
from bsg_models import EvaluationRequest, report_evaluation

MADE, FEW, MANY = 100, 1_000, 10_000
TARGET = 1.1


def require_sound(path: Path) -> None:
    """Check a dataset."""
    faults = check_dataset(path)
    assert not faults, faults[:3]


JOBS: dict[str, Callable[[Path], object]] = {
    "pairs": lambda path: write_pairs(path, PairsRecipe(draws=1)),
    "check": require_sound,
    "evaluate": lambda path: report_evaluation(
        EvaluationRequest(
            runs=("mixture",), dataset=path, out=path.with_name(f"{path.name}-results")
        )
    ),
}


def measure(hm3d: Path | None, *, few: int = FEW, many: int = MANY) -> Iterator[Speed]:
    """Yield what a building costs among many, and among few."""
    with tempfile.TemporaryDirectory() as folder:
        raw, made = Path(folder, "raw"), Path(folder, "made")
        list(write_synthetic(raw, scenes=MADE, seed=11))
        build_dataset(HM3DFolder(raw), made, scenes_per_shard=MADE)
        paths = [
            repeat(made, Path(folder, f"{turn}"), times=n // MADE)
            for turn, n in enumerate((MADE, MADE, few, many))
        ]
        for name, run in JOBS.items():
            _, start, one, other = (time_call(run, path) for path in paths)  # the first imports
            yield Speed(
                what=f"{name}: one more building of {many:,}",
                against=f"one more of {few:,}",
                ours_s=(other - start) / (many - MADE),
                theirs_s=(one - start) / (few - MADE),
                target=TARGET,
                kind="growth",
            )


def time_call(run: Callable[[Path], object], path: Path) -> float:
    """Return the seconds of processor that a call takes."""
    began = time.process_time()
    run(path)
    return time.process_time() - began


def repeat(made: Path, out: Path, *, times: int) -> Path:
    """Write a dataset that holds every building of another so often, and split it; return it."""
    data, size = Dataset.open(made), 16
    tables = {name: data.read_table(name) for name in TABLES}
    parts = [
        {name: take(table, data.scene_ids[first : first + size]) for name, table in tables.items()}
        for first in range(0, MADE, size)
    ]
    files = [
        write_parquet(
            out,
            f"{name}/part-{time * len(parts) + number:05d}.parquet",
            [rename(table, data.scene_ids, time)],
            table=name,
            class_space=data.manifest.class_space,
        )
        for time in range(times)
        for number, part in enumerate(parts)
        for name, table in part.items()
    ]
    totals = Totals.sum([data.manifest.totals] * times)
    update = {"files": tuple(sorted(files, key=lambda file: file.path)), "totals": totals}
    publish(out, data.manifest.model_copy(update={**update, "scenes_per_shard": size}))
    split_dataset(out, SplitRecipe(ratios=(0.8, 0.1, 0.1)))
    return out


def take(table: pa.Table, scenes: Sequence[str]) -> pa.Table:
    """Return the rows of some scenes."""
    return table.filter(pc.is_in(table["scene_id"], value_set=pa.array(scenes)))


def rename(table: pa.Table, scenes: Sequence[str], time: int) -> pa.Table:
    """Return rows of scenes with names that no other time has; each is a building of its own."""
    new = [
        f"{time * len(scenes) + number:06d}-{split_scene_id(scene)[1][:7]}{time:04d}"
        for number, scene in enumerate(scenes)
    ]
    places = pc.index_in(table["scene_id"], value_set=pa.array(scenes))
    named = pa.array(new).take(places.combine_chunks())
    for column in {"scene_id", "building"} & {*table.column_names}:
        place = table.schema.get_field_index(column)
        table = table.set_column(place, table.schema.field(place), named)
    return table


def main() -> None:
    """Measure with numbers of buildings of your own."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--buildings", type=int, nargs=2, default=(FEW, MANY))
    few, many = parser.parse_args().buildings
    for speed in measure(None, few=few, many=many):
        print(*speed.cells(), sep="  ", flush=True)


if __name__ == "__main__":
    main()
