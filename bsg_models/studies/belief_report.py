"""Apply a run to robots' graphs or masked buildings, and write the belief graphs."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt
from pydantic import Field

from bsg_data.arrays import Counts
from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.manifest import (
    COMPARED,
    ResolvedEntry,
    UnmappedEntry,
    describe_unmapped,
    list_resolved,
)
from bsg_data.errors import DatasetError, RecipeError
from bsg_data.files import resolve_links
from bsg_data.observation.partial_graph import PartialGraph, list_withheld, mask_dataset
from bsg_data.observation.robot_json import list_unmapped
from bsg_data.observation.said_share import Share
from bsg_data.recipes import MaskRecipe, Record
from bsg_data.result_folder import Place, replace_together, require_vacant
from bsg_data.scene.class_map import ClassMap, load_class_map
from bsg_data.scene.surroundings import KNOWN_SOURCES
from bsg_data.seals import SEAL, refuse_other_results, refuse_replacing, refuse_sealed_file
from bsg_models.belief.belief_graph import BeliefGraph, Mode, believe, rank_unseen
from bsg_models.belief.formats import choose_format, write_beliefs
from bsg_models.belief.graph_file import open_graph_file
from bsg_models.belief.hydra import SPARK_DSG, annotate_hydra, write_hydra
from bsg_models.belief.hydra_file import HydraFile
from bsg_models.belief.table_rows import FILES, NODES
from bsg_models.belief.tables import read_tables, write_tables
from bsg_models.inputs.folds import scenes_of
from bsg_models.rendering.explorer import View, write_explorer
from bsg_models.robot.told_shares import tell_shares
from bsg_models.runs.predictor import Predictor
from bsg_models.runs.run_folder import refuse_run
from bsg_models.runs.shipped import DEFAULT_MODEL

MOST_HELD = 200  # belief graphs kept in memory and put on a page; tables take any number


class MaskedScenes(Record):
    """Masked buildings of a dataset.

    Attributes:
        dataset: folder of a dataset; it must be split unless `scene` is named.
        mask: recipe that hides objects.
        split: split whose buildings are taken.
        fold: fold to test on, in a dataset of folds.
        scene: take this building alone.
    """

    dataset: Path
    mask: MaskRecipe = MaskRecipe()
    split: Literal["train", "val", "test"] = "val"
    fold: int | None = None
    scene: str | None = None


class BeliefRequest(Record):
    """What to believe about, and which files to write.

    Attributes:
        run: a model, as `find_model` takes it: path of a run, or name of a shipped model.
        graphs: files with robots' graphs, in this project's format or Spark-DSG's.
        scenes: masked buildings, instead of graphs.
        labels: label space of Hydra's graphs, as `load_label_space` takes it.
        hidden_share: share of the objects of every room that was not seen; None takes it from the
            graphs.
        hidden_shares: hidden share of single rooms, by room id or label.
        mode: which blind nodes to make: as many as are expected, or the top unseen classes.
        top: number of unseen classes per room.
        out: file for belief graphs, in the format of its suffix.
        hydra: file for one belief graph as Spark-DSG JSON: Hydra's own graph with the beliefs
            added, or a new one.
        tables: folder for all belief graphs as parquet.
        html: file for the explorer, with the first `MOST_HELD` graphs.
        force: replace existing files.
    """

    run: Path | str = DEFAULT_MODEL
    graphs: tuple[Path, ...] = ()
    scenes: MaskedScenes | None = None
    labels: str | None = None
    hidden_share: Share | None = None
    hidden_shares: dict[str, Share] = Field(default_factory=dict)
    mode: Mode = "complete"
    top: int = Field(default=3, ge=1)
    out: Path | None = None
    hydra: Path | None = None
    tables: Path | None = None
    html: Path | None = None
    force: bool = False

    @property
    def results(self) -> tuple[Path, ...]:
        """Files to write."""
        return tuple(self.named_results.values())

    @property
    def named_results(self) -> dict[str, Path]:
        """Attribute → file to write; the tables first, because they are the largest."""
        named = {name: getattr(self, name) for name in ("tables", "out", "hydra", "html")}
        return {name: path for name, path in named.items() if path is not None}


class UnseenClass(NamedTuple):
    """A class that was not seen in a room, with the probability that one is hidden there."""

    name: str
    presence: float
    expected: float


class RoomBelief(NamedTuple):
    """What is believed of one room.

    Attributes:
        scene_id: of the building.
        room: its label, else its name.
        seen: number of classified objects seen.
        expected_more: expected number of hidden objects.
        unseen: classes not seen in the room, the likeliest first.
    """

    scene_id: str
    room: str
    seen: int
    expected_more: float
    unseen: tuple[UnseenClass, ...]


class BeliefReport(NamedTuple):
    """What a run believes.

    Attributes:
        model: its name.
        graphs: one belief graph per partial graph, the first `MOST_HELD`.
        number: of all graphs.
        blind: number of blind nodes of all graphs.
        rooms: what is believed of each room of all graphs.
        unmapped: file → names that the class map does not know, the most frequent first, with the
            nearest known names for the first `COMPARED`.
        resolved: file → names that a rule explained.
        unknown_sources: file → its source, if that is not one of `KNOWN_SOURCES`.
        notes: file → further facts about how it was read, a sentence each.
    """

    model: str
    graphs: tuple[BeliefGraph, ...]
    number: int
    blind: int
    rooms: tuple[RoomBelief, ...]
    unmapped: dict[Path, tuple[UnmappedEntry, ...]]
    resolved: dict[Path, tuple[ResolvedEntry, ...]]
    unknown_sources: dict[Path, str]
    notes: dict[Path, tuple[str, ...]]


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
        BSGError: if a graph cannot be read.
        CheckpointError: if the run cannot be loaded.
    """
    _check_names(request)
    if not request.results:
        return _report(request, progress=progress)
    places = {name: _place(name, path) for name, path in request.named_results.items()}
    with replace_together(
        list(places.values()), refuse=lambda: _refuse_replacing(request)
    ) as staged:
        inside = dict(zip(places, staged, strict=True))
        return _report(request.model_copy(update=inside), progress=progress)


def _report(request: BeliefRequest, *, progress: Callable[[int, int], None] | None) -> BeliefReport:
    """Do the work of `report_beliefs`; the caller handles the places of the files."""
    wanted = _choose(request.scenes) if request.scenes else frozenset()
    predictor = Predictor(request.run)
    class_map = predictor.class_map if request.graphs else load_class_map()
    files = {
        path: open_graph_file(path, labels=request.labels, class_map=class_map)
        for path in request.graphs
    }
    graphs = {path: _tell(file.graph, request) for path, file in files.items()}
    total = len(graphs) or len(wanted)
    out_holds_one = request.out is not None and not choose_format(request.out).many
    if (out_holds_one or request.hydra) and total != 1:
        raise RecipeError(f"--out and --hydra take one graph, found {total}; use --tables")
    partial_graphs: Iterable[tuple[PartialGraph, Counts | None]]
    partial_graphs = ((graph, None) for graph in graphs.values())
    if request.scenes:
        partial_graphs = mask_dataset(request.scenes.dataset, wanted, request.scenes.mask)
    views: list[View] = []
    rooms: list[RoomBelief] = []
    number = blind = 0

    def believe_all() -> Iterator[BeliefGraph]:
        nonlocal number, blind
        for graph, truth in partial_graphs:
            expectation = predictor(graph, withheld=_withheld(request.scenes, graph))
            belief = believe(
                graph, expectation, mode=request.mode, top=request.top, model=predictor.name
            )
            if number < MOST_HELD:
                views.append(View(belief, truth))
            rooms.extend(describe_rooms(belief, rank_unseen(expectation, request.top)))
            number, blind = number + 1, blind + len(belief.blind)
            yield belief
            if progress:
                progress(number, total)

    _write_all(request, believe_all())
    _write(request, views, [file.hydra for file in files.values()])
    unmapped = {path: _list_unmapped(graph, class_map) for path, graph in graphs.items()}
    resolved = {path: _list_resolved(graph, class_map) for path, graph in graphs.items()}
    strange = {
        path: graph.source
        for path, graph in graphs.items()
        if graph.source is not None and graph.source not in KNOWN_SOURCES
    }
    return BeliefReport(
        model=predictor.name,
        graphs=tuple(view.belief for view in views),
        number=number,
        blind=blind,
        rooms=tuple(rooms),
        unmapped={path: names for path, names in unmapped.items() if names},
        resolved={path: names for path, names in resolved.items() if names},
        unknown_sources=strange,
        notes={path: file.notes for path, file in files.items()},
    )


def _tell(graph: PartialGraph, request: BeliefRequest) -> PartialGraph:
    return tell_shares(graph, every=request.hidden_share, rooms=request.hidden_shares)


def _list_unmapped(graph: PartialGraph, class_map: ClassMap) -> tuple[UnmappedEntry, ...]:
    return tuple(describe_unmapped(list_unmapped(graph), class_map, near=COMPARED))


def _list_resolved(graph: PartialGraph, class_map: ClassMap) -> tuple[ResolvedEntry, ...]:
    names = Counter(obj.raw_category for obj in graph.objects)
    return tuple(list_resolved(names, class_map))


def describe_rooms(
    belief: BeliefGraph, ranked: Sequence[npt.NDArray[np.int64]]
) -> Iterator[RoomBelief]:
    """Yield what is believed of every room.

    Args:
        belief: about a building with R rooms.
        ranked: for each of the 1 + R nodes, the unseen classes to name, the likeliest first.
    """
    partial, classes = belief.partial, belief.partial.class_space.classes
    inputs = belief.inputs
    hidden = belief.expected - inputs
    for number, room in enumerate(partial.rooms, 1):
        yield RoomBelief(
            scene_id=partial.scene_id,
            room=room.label or room.name,
            seen=int(inputs[number].sum()),
            expected_more=round(float(hidden[number].sum()), 3),
            unseen=tuple(
                UnseenClass(
                    classes[c],
                    round(float(belief.presence[number, c]), 4),
                    round(float(hidden[number, c]), 4),
                )
                for c in ranked[number]
            ),
        )


def _withheld(scenes: MaskedScenes | None, graph: PartialGraph) -> tuple[int, ...]:
    """Return the classes that the mask of a graph withholds; none for a robot's own graph."""
    if scenes is None:
        return ()
    return list_withheld(scenes.mask, graph)


def _choose(scenes: MaskedScenes) -> frozenset[str]:
    """Return the scenes of a dataset that were asked for."""
    data = Dataset.open(scenes.dataset)
    if scenes.scene is None:
        return frozenset(scenes_of(data, scenes.split, fold=scenes.fold))
    if scenes.scene not in data:
        raise DatasetError(f"{scenes.dataset}: has no scene {scenes.scene!r}")
    return frozenset([scenes.scene])


def _check_names(request: BeliefRequest) -> None:
    """Refuse files that are named twice, and a suffix of no format."""
    if request.out is not None:
        choose_format(request.out)
    paths = [path.absolute() for path in (*request.results, *request.graphs)]
    if len(set(paths)) < len(paths):
        raise RecipeError("one file is named twice")


def _place(name: str, path: Path) -> Place:
    """Return where one of the results is written."""
    return Place(resolve_links(path), last=SEAL) if name == "tables" else Place(path, is_file=True)


def _refuse_replacing(request: BeliefRequest) -> None:
    """Refuse to replace files without --force, and files that belong to other results."""
    for name, path in request.named_results.items():
        if name == "tables":
            refuse_other_results(path, NODES)
        else:
            refuse_sealed_file(path)
        if not request.force:
            require_vacant(path)
    for folder in (request.tables, request.out):
        if folder is not None and folder.is_dir():
            refuse_run(folder)
            refuse_replacing(folder, NODES, FILES)


def _write_all(request: BeliefRequest, beliefs: Iterator[BeliefGraph]) -> None:
    """Write belief graphs as they come; consume all of them even if no file needs them."""
    places = [request.tables] if request.tables else []
    if request.out and choose_format(request.out).many:
        places.append(request.out)
    if request.tables:
        write_tables(beliefs, request.tables)
    elif places:
        write_beliefs(beliefs, places[0])
    deque(beliefs, maxlen=0)
    if request.tables and len(places) == 2:
        write_beliefs(read_tables(request.tables), places[1])


def _write(
    request: BeliefRequest, views: list[View], originals: Sequence[HydraFile | None]
) -> None:
    """Write the other files; a belief about Hydra's graph is added to that graph."""
    beliefs = [view.belief for view in views]
    original = originals[0] if len(originals) == 1 else None
    if request.out and original is not None and choose_format(request.out).name == SPARK_DSG.name:
        annotate_hydra(beliefs[0], original, request.out)
    elif request.out and not choose_format(request.out).many:
        write_beliefs(beliefs, request.out)
    if request.hydra and original is not None:
        annotate_hydra(beliefs[0], original, request.hydra)
    elif request.hydra:
        write_hydra(beliefs[0], request.hydra)
    if request.html:
        write_explorer(views, request.html)
