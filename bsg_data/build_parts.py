"""Build a dataset in parts, in any order on any machines, and finish it at the end.

    DATASET.partial/.reports/plan.json          the plan, for `finalise_dataset`
    DATASET.partial/.reports/part-00012.json    shard 12 is done
    DATASET.partial/.reports/parts-of-10        a process built part i of 10

Part i of n builds every n-th shard, beginning with the i-th. All parts write into the folder of the
growing dataset. A finished shard is renamed into it, so parts need no lock and can be repeated.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path

from pydantic import ValidationError

from bsg_data.build import SCENES_PER_SHARD, BuildPlan, finish_build, plan_build
from bsg_data.build_shards import is_reported, read_report
from bsg_data.dataset.growth import (
    join_partial,
    make_parent,
    recall,
    refuse_overwriting,
    refuse_place,
)
from bsg_data.dataset.manifest import MANIFEST, Manifest
from bsg_data.dataset.publication import PLAN, REPORTS
from bsg_data.dataset.replacement import is_settled, name_growing
from bsg_data.errors import DatasetError, RecipeError
from bsg_data.files import AnyPath, resolve_links
from bsg_data.inputs.bounded_file import read_bytes
from bsg_data.inputs.bounds import MANIFEST_FILE
from bsg_data.lock import hold
from bsg_data.recipes import name_fault
from bsg_data.sources.source import Source

_MOST_NAMED = 20  # parts
_PARTS_OF = "parts-of-"
_NUMBER = re.compile("[1-9][0-9]{0,17}")  # other marks are not ours


@dataclass(frozen=True, slots=True)
class Part:
    """Part `number` of `of` parts, from 1. A build needs all of them.

    Raises:
        RecipeError: if `number` is not 1 to `of`.
    """

    number: int
    of: int

    def __post_init__(self) -> None:
        if not 1 <= self.number <= self.of:
            raise RecipeError(f"part {self.number}/{self.of}: expected I/N with I from 1 to N")


@dataclass(frozen=True, slots=True)
class BuiltPart:
    """What a part of a build built.

    Attributes:
        shards: numbers of its shards.
        scenes: number of scenes in them.
        missing: numbers of the shards of the dataset that are still missing.
    """

    shards: tuple[int, ...]
    scenes: int
    missing: tuple[int, ...]


def build_part(
    source: Source,
    out: AnyPath,
    part: Part,
    *,
    class_map: AnyPath | None = None,
    strict: bool = False,
    force: bool = False,
    scenes_per_shard: int = SCENES_PER_SHARD,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> BuiltPart:
    """Build one part of the shards of a dataset; other processes can build the other parts.

    Args:
        source: as in `build_dataset`; the same for all parts.
        out: folder of the dataset, on a file system that all parts see.
        part: the part to build.
        class_map: as in `build_dataset`.
        strict: as in `build_dataset`.
        force: allow a finished dataset at `out`; `finalise_dataset` replaces it.
        scenes_per_shard: number of scenes in each part of a table.
        executor: runs the shards in parallel; None builds them one by one in this process.
        progress: called with (shards done, shards of this part).

    Returns:
        What the part built, and which shards are still missing.

    Raises:
        SourceError: if no scene is found; with `strict`, if any is unreadable.
        UnmappedNameError: with `strict`, for a name that is not in the map.
        RecipeError: if `scenes_per_shard` is impossible.
        DatasetError: if parts of another build are there, or a file cannot be written.
    """
    out = resolve_links(out)
    refuse_place(out)
    refuse_overwriting(out, force=force)
    planned = plan_build(
        source, class_map=class_map, strict=strict, scenes_per_shard=scenes_per_shard
    )
    make_parent(out)
    growing = join_partial(out, planned.plan.recipe, planned.plan, prepare=planned.keep_map)
    _leave_mark(growing, part)
    shards = tuple(range(part.number - 1, planned.plan.shards, part.of))
    reports = planned.make(shards, growing, executor=executor, progress=progress)
    every = range(planned.plan.shards)
    missing = tuple(number for number in every if not is_reported(growing, number))
    return BuiltPart(shards, sum(report.totals.scenes for report in reports), missing)


def finalise_dataset(
    out: AnyPath, *, force: bool = False, progress: Callable[[int, int], None] | None = None
) -> Manifest:
    """Finish a dataset that was built in parts, and return its manifest.

    The bytes equal those of `build_dataset`.

    Args:
        out: folder of the dataset, as in `build_part`.
        force: replace a finished dataset.
        progress: called with (shards verified, shards in all).

    Raises:
        DatasetError: if there are no parts, a shard is missing or damaged, or `out` is taken.
        SourceError: if no scene could be read.
    """
    out = resolve_links(out)
    growing = name_growing(out)
    if (out / PLAN).is_file() and out.name.endswith(".partial"):
        dataset = out.with_name(out.name.removesuffix(".partial"))
        raise DatasetError(
            f"{out}: is the folder of the growing dataset; name the dataset itself: "
            f"bsg-data finalise {dataset}"
        )
    refuse_place(out)
    if is_settled(out):
        _refuse_finished(out)
        refuse_overwriting(out, force=force)
    make_parent(out)
    with hold(out):
        done = recall(out)
        if done is not None and not (growing / PLAN).is_file():
            return done
        _refuse_finished(out)
        refuse_overwriting(out, force=force)
        plan = _read_plan(growing)
        reports, missing = [], []
        for number in range(plan.shards):
            report = read_report(growing, number)
            if report is None:
                missing.append(number)
            else:
                reports.append(report)
            if progress is not None:
                progress(number + 1, plan.shards)
        if missing:
            raise DatasetError(_tell_missing(growing, missing, plan.shards))
        return finish_build(plan, reports, out, force=force, where=out)


def _leave_mark(growing: Path, part: Part) -> None:
    """Note in the growing dataset into how many parts it is divided; this holds no lock.

    Raises:
        DatasetError: if the dataset was finished or removed, or the note cannot be written.
    """
    mark = growing / REPORTS / f"{_PARTS_OF}{part.of}"
    try:
        mark.touch()
    except OSError as error:
        raise DatasetError(
            f"{mark}: cannot be written ({error.strerror or error}); if the dataset was not "
            "finished meanwhile, run this part again"
        ) from error


def _refuse_finished(out: Path) -> None:
    if (out / MANIFEST).is_file() and not name_growing(out).exists():
        raise DatasetError(f"{out}: is finished already; there is no part left to finish")


def _read_plan(growing: Path) -> BuildPlan:
    path = growing / PLAN
    if not path.is_file():
        raise DatasetError(
            f"{growing}: holds no part of a build; build parts with `bsg-data build --parts I/N`"
        )
    try:
        return BuildPlan.model_validate_json(read_bytes(path, MANIFEST_FILE, error=DatasetError))
    except (DatasetError, ValidationError) as error:
        said = name_fault(error) if isinstance(error, ValidationError) else error
        raise DatasetError(
            f"{path}: cannot be read ({said}); remove it and run any part again"
        ) from error


def _tell_missing(growing: Path, missing: list[int], shards: int) -> str:
    """Return which parts to run again, in the finest division that was used."""
    marks = (growing / REPORTS).glob(f"{_PARTS_OF}*")
    said = (mark.name.removeprefix(_PARTS_OF) for mark in marks)
    of = max((int(number) for number in said if _NUMBER.fullmatch(number)), default=1)
    parts = sorted({number % of + 1 for number in missing})
    named = ", ".join(f"{part}/{of}" for part in parts[:_MOST_NAMED])
    more = f" and {len(parts) - _MOST_NAMED:,} more" if len(parts) > _MOST_NAMED else ""
    return (
        f"{growing}: {len(missing):,} of {shards:,} shards missing or damaged; run these again "
        f"by --parts: {named}{more}"
    )
