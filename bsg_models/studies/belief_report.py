"""Apply a model to robots' graphs or masked buildings, and write the belief graphs."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from bsg_data.arrays import Counts
from bsg_data.dataset.dataset import Dataset
from bsg_data.errors import DatasetError, RecipeError
from bsg_data.files import resolve_links
from bsg_data.observation.partial_graph import PartialGraph, list_withheld, mask_dataset
from bsg_data.recipes import MaskRecipe
from bsg_data.result_folder import Place, replace_together, require_vacant
from bsg_data.scene.class_map import ClassMap
from bsg_data.seals import SEAL, refuse_other_results, refuse_replacing, refuse_sealed_file
from bsg_models.belief.belief_graph import BeliefGraph, Mode, believe, rank_unseen
from bsg_models.belief.formats import choose_format, write_beliefs
from bsg_models.belief.graph_file import GraphFile, use_class_map
from bsg_models.belief.hydra import SPARK_DSG, HydraFile, annotate_hydra, write_hydra
from bsg_models.belief.tables import FILES, NODES, write_tables
from bsg_models.inputs.folds import scenes_of
from bsg_models.rendering.explorer import View, write_explorer
from bsg_models.robot.answers import ExpectedClass
from bsg_models.runs.predictor import Predictor
from bsg_models.runs.run_folder import refuse_run
from bsg_models.runs.shipped import DEFAULT_MODEL

MOST_HELD = 200  # belief graphs kept in memory and put on a page; tables take any number


@dataclass(frozen=True, slots=True)
class MaskedScenes:
    """Masked buildings of a dataset.

    Attributes:
        dataset: folder of a dataset; it must be split unless `scene` is named.
        mask: recipe that hides objects.
        split: split whose buildings are taken.
        fold: fold to test on, in a dataset of folds.
        scene: take this building alone.
    """

    dataset: Path
    mask: MaskRecipe = field(default_factory=MaskRecipe)
    split: Literal["train", "val", "test"] = "val"
    fold: int | None = None
    scene: str | None = None


@dataclass(frozen=True, slots=True)
class BeliefRequest:
    """What to believe about, and which files to write.

    Attributes:
        run: a model, as `find_model` takes it: path of a run, or name of a shipped model.
        graphs: robots' graphs.
        scenes: masked buildings, instead of graphs.
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
    graphs: tuple[GraphFile, ...] = ()
    scenes: MaskedScenes | None = None
    mode: Mode = "complete"
    top: int = 3
    out: Path | None = None
    hydra: Path | None = None
    tables: Path | None = None
    html: Path | None = None
    force: bool = False

    @property
    def results(self) -> dict[str, Path]:
        """Attribute → file to write; the tables first, because they are the largest."""
        named = {name: getattr(self, name) for name in ("tables", "out", "hydra", "html")}
        return {name: path for name, path in named.items() if path is not None}


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
    unseen: tuple[ExpectedClass, ...]


class BeliefReport(NamedTuple):
    """What a model believes.

    Attributes:
        model: its name.
        class_map: by which robots' graphs were read.
        graphs: one belief graph per partial graph, the first `MOST_HELD`.
        number: of all graphs.
        blind: number of blind nodes of all graphs.
        rooms: what is believed of each room of all graphs.
    """

    model: str
    class_map: ClassMap
    graphs: tuple[BeliefGraph, ...]
    number: int
    blind: int
    rooms: tuple[RoomBelief, ...]


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
    if request.out is not None:
        choose_format(request.out)
    paths = [path.absolute() for path in request.results.values()]
    paths += [file.path.absolute() for file in request.graphs]
    if len(set(paths)) < len(paths):
        raise RecipeError("one file is named twice", code="output-twice")
    if not request.results:
        return _report(request, progress=progress)
    places = {name: _place(name, path) for name, path in request.results.items()}
    with replace_together(
        list(places.values()), refuse=lambda: _refuse_replacing(request)
    ) as staged:
        inside: dict[str, Any] = dict(zip(places, staged, strict=True))
        return _report(replace(request, **inside), progress=progress)


def _report(request: BeliefRequest, *, progress: Callable[[int, int], None] | None) -> BeliefReport:
    """Do the work of `report_beliefs`; the caller handles the places of the files."""
    wanted = _choose(request.scenes) if request.scenes else frozenset()
    total = len(request.graphs) or len(wanted)
    streamed = _choose_streamed(request, total)
    predictor = Predictor(request.run)
    class_map = predictor.class_map
    views: list[View] = []
    rooms: list[RoomBelief] = []
    number = blind = 0

    def believe_all() -> Iterator[BeliefGraph]:
        nonlocal number, blind
        for graph, truth, withheld in _list_graphs(request, class_map, wanted):
            expectation = predictor(graph, withheld=withheld)
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

    beliefs = believe_all()
    if streamed == "tables" and request.tables:
        write_tables(beliefs, request.tables)
    elif streamed == "out" and request.out:
        write_beliefs(beliefs, request.out)
    deque(beliefs, maxlen=0)
    original = request.graphs[0].hydra if len(request.graphs) == 1 else None
    _write(request, views, original, streamed=streamed)
    graphs = tuple(view.belief for view in views)
    return BeliefReport(predictor.name, class_map, graphs, number, blind, tuple(rooms))


def _list_graphs(
    request: BeliefRequest, class_map: ClassMap, wanted: frozenset[str]
) -> Iterator[tuple[PartialGraph, Counts | None, Sequence[int]]]:
    """Yield the graphs with their truth, if known, and the classes that their mask withholds."""
    for file in request.graphs:
        yield use_class_map(file.graph, class_map), None, ()
    if request.scenes:
        mask = request.scenes.mask
        for graph, truth in mask_dataset(request.scenes.dataset, wanted, mask):
            yield graph, truth, list_withheld(mask, graph)


def _choose(scenes: MaskedScenes) -> frozenset[str]:
    """Return the scenes of a dataset that were asked for."""
    data = Dataset.open(scenes.dataset)
    if scenes.scene is None:
        return frozenset(scenes_of(data, scenes.split, fold=scenes.fold))
    if scenes.scene not in data:
        raise DatasetError(
            f"{scenes.dataset}: has no scene {scenes.scene!r}",
            code="scene-unknown",
            where=scenes.scene,
        )
    return frozenset([scenes.scene])


def _choose_streamed(request: BeliefRequest, total: int) -> str | None:
    """Return which result takes belief graphs as they come; the others are written from memory."""
    many = request.out is not None and choose_format(request.out).many
    if (request.hydra or (request.out and not many)) and total != 1:
        raise RecipeError(
            f"--out and --hydra take one graph, found {total}; use --tables", code="graphs-several"
        )
    if request.tables and many and total > MOST_HELD:
        raise RecipeError(
            f"--out beside --tables takes at most {MOST_HELD} graphs, found {total:,}; give one of "
            "them",
            code="graphs-several",
        )
    return "tables" if request.tables else "out" if many else None


def describe_rooms(
    belief: BeliefGraph, ranked: Sequence[npt.NDArray[np.int64]]
) -> Iterator[RoomBelief]:
    """Yield what is believed of every room.

    Args:
        belief: about a building with R rooms.
        ranked: for each of the 1 + R nodes, the unseen classes to name, the likeliest first.
    """
    partial, classes = belief.partial, belief.partial.class_space.classes
    inputs, hidden = belief.inputs, belief.hidden
    for number, room in enumerate(partial.rooms, 1):
        unseen = (
            ExpectedClass(
                classes[c], float(belief.presence[number, c]), float(hidden[number, c]), seen=0
            )
            for c in ranked[number]
        )
        yield RoomBelief(
            scene_id=partial.scene_id,
            room=room.label or room.name,
            seen=int(inputs[number].sum()),
            expected_more=float(hidden[number].sum()),
            unseen=tuple(unseen),
        )


def _place(name: str, path: Path) -> Place:
    """Return where one of the results is written."""
    return Place(resolve_links(path), last=SEAL) if name == "tables" else Place(path, is_file=True)


def _refuse_replacing(request: BeliefRequest) -> None:
    """Refuse to replace files without --force, and files that belong to other results."""
    for name, path in request.results.items():
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


def _write(
    request: BeliefRequest, views: list[View], original: HydraFile | None, *, streamed: str | None
) -> None:
    """Write the files that are not streamed; beliefs go into Hydra's own graph."""
    beliefs: Iterable[BeliefGraph] = [view.belief for view in views]
    paths = [request.hydra] if request.hydra else []
    if request.out and streamed != "out":
        if choose_format(request.out).name == SPARK_DSG.name:
            paths.append(request.out)
        else:
            write_beliefs(beliefs, request.out)
    for path in paths:
        if original is None:
            write_hydra(views[0].belief, path)
        else:
            annotate_hydra(views[0].belief, original, path)
    if request.html:
        write_explorer(views, request.html)
