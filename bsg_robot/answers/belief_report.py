"""Apply a model to robots' graphs or masked buildings, and write the belief graphs."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, NamedTuple

from bsg_data.arrays import Counts
from bsg_data.dataset.dataset import Dataset
from bsg_data.errors import DatasetError, RecipeError
from bsg_data.files import resolve_links
from bsg_data.places import RESULTS, refuse_datasets, refuse_file, require_free
from bsg_data.recipes import MaskRecipe
from bsg_data.results import was_stopped, write_files, write_results
from bsg_models.belief.belief_graph import BeliefGraph, Mode, believe, rank_unseen
from bsg_models.belief.expectation import Expectation
from bsg_models.belief.masked_graph import list_withheld, mask_dataset
from bsg_models.inputs.folds import scenes_of
from bsg_models.rendering.explorer import ShownBelief, write_explorer
from bsg_models.runs.found_model import DEFAULT_MODEL
from bsg_models.runs.predictor import Predictor
from bsg_robot.answers.kinds import SURE
from bsg_robot.answers.place import ExpectedClass, RoomKind
from bsg_robot.answers.seen_building import SeenBuilding
from bsg_robot.graph.annotation import annotate_hydra
from bsg_robot.graph.formats import FormatRow, choose_format, write_beliefs
from bsg_robot.graph.graph_file import GraphFile
from bsg_robot.graph.reports import reclassify
from bsg_robot.things.pieces import find_pieces_of

MOST_HELD = 200  # belief graphs kept in memory and put on a page


@dataclass(frozen=True, slots=True)
class BeliefRequest:
    """What to believe about, and which files to write."""

    run: Path | str = DEFAULT_MODEL  # a model, as `find_model` takes it
    graphs: tuple[GraphFile, ...] = ()  # of robots
    # instead of graphs: masked buildings of a dataset, which must be split unless `scene` is named
    dataset: Path | None = None
    mask: MaskRecipe = field(default_factory=MaskRecipe)
    split: Literal["train", "val", "test"] = "val"
    scene: str | None = None  # this building alone
    mode: Mode = "complete"  # which blind nodes: as many as are expected, or the top unseen classes
    top: int = 3  # number of unseen classes per room
    out: tuple[Path, ...] = ()  # files to write, each in the format of its suffix
    force: bool = False  # replace existing files
    now: float | None = None  # what time it is; None: that of each graph
    answer: Mapping[str, Any] | None = None  # to a question about the one graph, for its page


class RoomBelief(NamedTuple):
    """What is believed of one room."""

    scene_id: str
    room: str  # its label, else its name
    seen: int  # number of classified objects seen
    expected_more: float  # number of hidden objects
    unseen: tuple[ExpectedClass, ...]  # classes not seen in the room, the likeliest first
    kinds: tuple[RoomKind, ...]  # that the room may be of; none of a room of a dataset


class BeliefReport(NamedTuple):
    """What a model believes."""

    model: str
    notes: tuple[tuple[str, ...], ...]  # on how each robot's graph was read, a sentence each
    graphs: tuple[BeliefGraph, ...]  # one per partial graph, the first `MOST_HELD`
    number: int  # of all graphs
    blind: int  # number of blind nodes of all graphs
    rooms: tuple[RoomBelief, ...]  # of all graphs


def report_beliefs(
    request: BeliefRequest, *, progress: Callable[[int, int], None] | None = None
) -> BeliefReport:
    """Apply a model as a request asks, write the files, and return what is believed.

    Args:
        request: the graphs or buildings, the model, and the files to write.
        progress: called with (graphs done, graphs in all).

    Raises:
        DatasetError: if the dataset lacks what is asked for, or a file already exists.
        RecipeError: if a file is named twice, or a file for one graph is asked to hold several.
        CheckpointError: if the run cannot be loaded.
    """
    left = was_stopped(request.out)
    results = _check_outputs(request, left=left)
    predictor = Predictor(request.run)
    wanted = _choose_scenes(request, fold=predictor.fold)
    total = len(request.graphs) or len(wanted)
    streamed = _choose_streamed(results, total)
    views: list[ShownBelief] = []
    notes: list[tuple[str, ...]] = []
    rooms: list[RoomBelief] = []
    blind: list[int] = []  # of each graph

    def believe_all() -> Iterator[BeliefGraph]:
        for asked in _ask_all(request, predictor, wanted):
            if len(views) < MOST_HELD:
                kinds = tuple(map(_say_kind, asked.kinds))
                view = ShownBelief(asked.belief, asked.truth, answer=request.answer, kinds=kinds)
                views.append(view)
                notes.append(asked.notes)
            rooms.extend(_describe_rooms(asked, request.top))
            blind.append(len(asked.belief.blind))
            yield asked.belief
            if progress:
                progress(len(blind), total)

    with _open_outputs(results, force=request.force, left=left) as staged:
        beliefs = believe_all()
        if streamed is not None:
            _write_all(streamed[0], beliefs, staged[streamed[1]])
        deque(beliefs, maxlen=0)
        for row, path in results:
            if (row, path) != streamed:
                _write(row, staged[path], request, views)
    graphs = tuple(view.belief for view in views)
    return BeliefReport(predictor.name, tuple(notes), graphs, len(blind), sum(blind), tuple(rooms))


def _check_outputs(request: BeliefRequest, *, left: bool) -> list[tuple[FormatRow, Path]]:
    """Return the files to write, each with its format; what may not be written is refused."""
    results = [(choose_format(path), path) for path in request.out]
    paths = [path.absolute() for path in (*request.out, *(file.path for file in request.graphs))]
    for path in (path for path, times in Counter(paths).items() if times > 1):
        raise RecipeError(f"{path}: is named twice; name it once", code="output-twice", where=path)
    for row, path in results:
        if not _annotates(row, request):
            row.require_writer(path)
        if row.report:
            refuse_datasets(path)
            require_free(resolve_links(path), RESULTS, force=request.force)
        else:
            refuse_file(path, force=request.force or left)
    return results


class _Asked(NamedTuple):
    """A graph with what is believed of it."""

    belief: BeliefGraph
    expectation: Expectation
    truth: Counts | None = None  # of a masked building
    kinds: tuple[tuple[RoomKind, ...], ...] = ()  # by room, of a robot's graph
    notes: tuple[str, ...] = ()


def _ask_all(
    request: BeliefRequest, predictor: Predictor, wanted: frozenset[str]
) -> Iterator[_Asked]:
    """Yield the graphs, and what is believed: of masked buildings, what annotators would note."""
    mode, top = request.mode, request.top
    for file in request.graphs:
        graph = reclassify(file.graph, predictor.class_map)
        seen = SeenBuilding(graph, predictor, notes=file.notes)
        if request.now is not None:
            seen.passes(until=request.now)
        kinds = tuple(seen.kinds(room) for room in seen.rooms)
        belief = seen.belief(mode=mode, top=top)
        yield _Asked(belief, seen.expectation(), kinds=kinds, notes=seen.notes)
    if request.dataset is not None:
        for graph, truth in mask_dataset(request.dataset, wanted, request.mask):
            believed = predictor(graph, withheld=list_withheld(request.mask, graph))
            pieces = find_pieces_of(graph, believed.presence)
            belief = believe(
                graph, believed, mode=mode, top=top, model=predictor.name, piece_of=pieces
            )
            yield _Asked(belief, believed, truth)


def _say_kind(kinds: Sequence[RoomKind]) -> str:
    """Say which kind a room is taken for; empty if none is likelier than all others."""
    first = next((kind for kind in kinds if kind.probability > SURE), None)
    return "" if first is None else f"{first.name} ({first.probability:.0%})"


def _choose_scenes(request: BeliefRequest, *, fold: int | None) -> frozenset[str]:
    """Return the scenes of a dataset that were asked for."""
    if request.dataset is None:
        return frozenset()
    data = Dataset.open(request.dataset)
    if request.scene is None:
        return frozenset(
            scenes_of(data, request.split, fold=fold if "fold-0" in data.splits else None)
        )
    if request.scene not in data:
        raise DatasetError(
            f"{request.dataset}: has no scene {request.scene!r}",
            code="scene-unknown",
            where=request.scene,
        )
    return frozenset([request.scene])


def _choose_streamed(
    results: Sequence[tuple[FormatRow, Path]], total: int
) -> tuple[FormatRow, Path] | None:
    """Return which result takes belief graphs as they come; the others are written from memory."""
    single = [path for row, path in results if row.write_all is None]
    if total != 1 and single:
        raise RecipeError(
            f"--out {single[0]}: holds one graph, found {total}; write a page (.html), or add "
            "a format of many graphs (docs/belief.md)",
            code="graphs-several",
        )
    many = [
        result for result in results if result[0].write_all is not None and result[0].name != "html"
    ]
    if len(many) > 1 and total > MOST_HELD:
        raise RecipeError(
            f"--out {many[1][1]}: only one file takes more than {MOST_HELD} graphs, found "
            f"{total:,}; leave one out",
            code="graphs-several",
        )
    return many[0] if many else None


def _describe_rooms(asked: _Asked, top: int) -> Iterator[RoomBelief]:
    graph, expectation = asked.belief.partial, asked.expectation
    ranked, classes = rank_unseen(expectation, top), graph.class_space.classes
    presence, hidden = expectation.presence, expectation.hidden
    for number, room in enumerate(graph.rooms, 1):
        unseen = (
            ExpectedClass(classes[c], float(presence[number, c]), float(hidden[number, c]), seen=0)
            for c in ranked[number]
        )
        yield RoomBelief(
            scene_id=graph.scene_id,
            room=room.label or room.name,
            seen=int(expectation.inputs[number].sum()),
            expected_more=float(hidden[number].sum()),
            unseen=tuple(unseen),
            kinds=asked.kinds[number - 1] if asked.kinds else (),
        )


@contextmanager
def _open_outputs(
    results: Sequence[tuple[FormatRow, Path]], *, force: bool, left: bool
) -> Iterator[Mapping[Path, Path]]:
    """Yield where to write each result; files are put in place before folders."""
    with ExitStack() as opened:
        folders = {
            path: opened.enter_context(write_results(path, report=row.report, force=force))
            for row, path in results
            if row.report
        }
        files = [path for row, path in results if not row.report]
        yield {**folders, **opened.enter_context(write_files(files, force=force, left=left))}


def _write_all(row: FormatRow, beliefs: Iterable[BeliefGraph], path: Path) -> None:
    if row.report and row.write_all:
        row.write_all(beliefs, path)
    else:
        write_beliefs(beliefs, path, row)


def _write(
    row: FormatRow, path: Path, request: BeliefRequest, views: Sequence[ShownBelief]
) -> None:
    """Write a result that is not streamed; beliefs go into Hydra's own graph."""
    if row.name == "html":
        write_explorer(views, path)
    elif _annotates(row, request):
        annotate_hydra(views[0].belief, request.graphs[0], path)
    else:
        _write_all(row, [view.belief for view in views], path)


def _annotates(row: FormatRow, request: BeliefRequest) -> bool:
    """Return whether a format takes the one graph of a request, which is Hydra's."""
    is_single = len(request.graphs) == 1
    return row.name == "spark-dsg" and is_single and request.graphs[0].document is not None
