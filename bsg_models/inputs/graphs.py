"""Masked buildings as PyG graphs: node 0 the building, rooms after it.

`MaskedGraphs` reads the stored pairs of a split, or draws masks itself from the shards. A dataset
is opened once a process and packed; the key is its manifest's hash, so a changed one is read again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Literal

import numpy as np
import numpy.typing as npt
import torch
from torch_geometric.data import Data, Dataset

from bsg_data.dataset.categories import OtherObjects, choose_vocabulary, place_columns, read_others
from bsg_data.dataset.histograms import Counts, read_adjacency, read_cells, to_histograms
from bsg_data.dataset.manifest import Manifest, hash_manifest, read_manifest
from bsg_data.dataset.shards import describe_file
from bsg_data.dataset.splits import read_splits
from bsg_data.errors import DatasetError
from bsg_data.observation.masks import sample_hidden, sample_visited, share_hidden
from bsg_data.observation.pairs import histogram_column, read_pairs
from bsg_data.recipes import MaskRecipe
from bsg_models.inputs.search_masks import sample_search, view_search

EdgeSet = Literal["up", "down", "adjacent", "complete"]
Split = Literal["train", "val", "test"]


@dataclass(frozen=True, eq=False)
class Buildings:
    """An opened dataset.

    Attributes:
        path: its folder.
        manifest: what it says of itself.
        sha256: of the manifest.
        cells: scene id → `[1 + R, C]`.
        others: scene id → its objects outside the classes.
        adjacency: scene id → pairs of adjacent rooms.
        splits: split or fold → scene ids; empty before `bsg-data split`.
    """

    path: Path
    manifest: Manifest
    sha256: str
    cells: dict[str, Counts]
    others: dict[str, OtherObjects]
    adjacency: dict[str, list[tuple[int, int]]]
    splits: dict[str, tuple[str, ...]]

    def names_of(self, part: Split, *, fold: int | None = None) -> tuple[str, ...]:
        """Return the splits that train, val or test are taken from.

        Args:
            part: which.
            fold: with a dataset of K folds, test is this one; see `scenes_of`.

        Raises:
            DatasetError: if the dataset is not split that way, or the part is empty.
        """
        names = tuple(self.splits)
        if not names:
            raise DatasetError(f"{self.path}: is not split yet; run `bsg-data split` first")
        folds = len(names) if names[0].startswith("fold-") else 0
        if folds and fold is None:
            raise DatasetError(
                f"{self.path}: is split into {folds} folds; say which one to test on, as in "
                "`--set data.fold=0`"
            )
        if fold is not None and not 0 <= fold < folds:
            raise DatasetError(f"{self.path}: has {folds or 'no'} folds; there is no fold {fold}")
        chosen: tuple[str, ...]
        if fold is None:
            chosen = tuple(name for name in names if name == str(part))
        else:
            test, val = f"fold-{fold}", f"fold-{(fold + 1) % folds}"
            rest = tuple(name for name in names if name != test)
            chosen = {"test": (test,), "val": (val,), "train": rest}[part]
        if not chosen:
            raise DatasetError(f"{self.path}: its {part} split is empty; split it in another way")
        return chosen

    def scenes_of(self, part: Split, *, fold: int | None = None) -> tuple[str, ...]:
        """Return the scene ids of train, val or test.

        With a dataset of K folds, test is `fold`, val every other building of the next fold (a
        tenth of all for 5 folds), and train all the rest: buildings are what learning lacks.
        """
        names = self.names_of(part, fold=fold)
        scenes = tuple(scene for name in names for scene in self.splits[name])
        if fold is None or part == "test":
            return scenes
        (next_fold,) = self.names_of("val", fold=fold)
        held = set(self.splits[next_fold][::2])
        return tuple(scene for scene in scenes if (scene in held) == (part == "val"))

    def present(self, scene: str, vocabulary: tuple[str, ...]) -> npt.NDArray[np.bool_]:
        """Return which categories of a vocabulary are where in a scene, `[1 + R, V]`."""
        others = self.others[scene]
        columns = _place_once(others.categories, vocabulary)
        found = np.zeros((len(others.cells), len(vocabulary)), dtype=bool)
        found[:, columns[columns >= 0]] = others.cells[:, columns >= 0] > 0
        return found

    def choose_vocabulary(self, scenes: Sequence[str], *, min_scenes: int) -> tuple[str, ...]:
        """Return the categories outside the classes that occur in enough of some scenes."""
        return choose_vocabulary((self.others[scene] for scene in scenes), min_scenes=min_scenes)


def open_dataset(path: Path) -> Buildings:
    """Open a dataset, from memory if its manifest has not changed since.

    Raises:
        DatasetError: if it is missing, unfinished or damaged.
    """
    read_manifest(path)  # a missing manifest is reported in words, not as a failed hash
    return _open(path.absolute(), hash_manifest(path))


@lru_cache(maxsize=8)
def _open(path: Path, sha256: str) -> Buildings:
    manifest = read_manifest(path)
    for entry in manifest.files:
        if (
            not (path / entry.path).is_file()
            or describe_file(path, entry.path, rows=entry.rows) != entry
        ):
            raise DatasetError(
                f"{path / entry.path}: is not what the manifest says; `bsg-data check`"
            )
    return Buildings(
        path=path,
        manifest=manifest,
        sha256=sha256,
        cells=read_cells(path, manifest=manifest),
        others=read_others(path, manifest=manifest),
        adjacency=read_adjacency(path, manifest=manifest),
        splits=read_splits(path, manifest=manifest) if manifest.split else {},
    )


@dataclass(frozen=True, eq=False)
class MaskedBuilding:
    """One draw of one building, `N` nodes of interest.

    Attributes:
        scene_id: of the building.
        draw: number of the mask.
        inputs: `[N, C]` histograms that the mask leaves.
        targets: `[N, C]` histograms of what is there.
        visited: `[N]` whether the robot entered.
        share: `[N]` of its objects that a node hides, as far as a robot knows.
        others: `[N, V]` visible objects outside the classes by category; V = 0 unless asked for.
        withheld: `[N, C]` where the mask shows nothing of a class.
    """

    scene_id: str
    draw: int
    inputs: npt.NDArray[np.integer]
    targets: npt.NDArray[np.integer]
    visited: npt.NDArray[np.bool_]
    share: npt.NDArray[np.float64]
    others: npt.NDArray[np.integer]
    withheld: npt.NDArray[np.bool_]


class MaskedGraphs(Dataset):  # type: ignore[misc]
    """Masked buildings of one split as `torch_geometric.data.Data`.

    Each graph has `x` `[N, C]` input and `y` `[N, C]` target histograms (float), `others` `[N, V]`
    visible objects outside the classes by the categories of a vocabulary, `edge_index` `[2, E]`,
    `adjacent_index` `[2, A]` rooms that are known to be adjacent, both ways,
    `is_building` `[N]`, `visited` `[N]`, `fraction` `[N]` (the share of its objects that each node
    hides, see `bsg_data.observation.masks.share_hidden`), `withheld` `[N, C]` (where that of a
    class is 1, see `bsg_models.inputs.search_masks`), and `scene_id` and `draw`.

    Example:
        >>> graphs = MaskedGraphs.stored(Path("dataset"), "train")  # doctest: +SKIP
        >>> graphs[0].x.shape  # doctest: +SKIP
        torch.Size([15, 45])
    """

    def __init__(
        self,
        masked: Sequence[MaskedBuilding],
        *,
        edges: Sequence[EdgeSet] = ("up", "down"),
        adjacency: dict[str, list[tuple[int, int]]] | None = None,
    ) -> None:
        super().__init__()
        self.masked = tuple(masked)
        self._adjacency = adjacency or {}
        self._edges = tuple(edges)

    @classmethod
    def stored(
        cls,
        path: Path | Buildings,
        part: Split,
        *,
        fold: int | None = None,
        edges: Sequence[EdgeSet] = ("up", "down"),
        vocabulary: tuple[str, ...] = (),
    ) -> MaskedGraphs:
        """Read the stored pairs of a split, of a dataset's folder or of one that is open.

        The pairs hold histograms of the classes; what is visible outside the classes is drawn from
        their recipe.

        Raises:
            DatasetError: if there are none.
        """
        data = path if isinstance(path, Buildings) else open_dataset(path)
        scenes = set(data.scenes_of(part, fold=fold))
        masked = [
            one
            for name in data.names_of(part, fold=fold)
            for one in _read_masked(data.path, name, data.sha256, vocabulary)
            if one.scene_id in scenes
        ]
        return cls(masked, edges=edges, adjacency=data.adjacency)

    @classmethod
    def fresh(
        cls,
        path: Path | Buildings,
        part: Split,
        *,
        mask: MaskRecipe,
        draw: int,
        fractions: tuple[float, float] | None = None,
        withhold: float = 0.0,
        fold: int | None = None,
        edges: Sequence[EdgeSet] = ("up", "down"),
        vocabulary: tuple[str, ...] = (),
    ) -> MaskedGraphs:
        """Draw mask number `draw` of every building of a split, of a folder or an open dataset.

        Args:
            path: of the dataset, or one that is open.
            part: train, val or test.
            mask: whose strategy, fraction and seed are used.
            draw: number of the mask.
            fractions: from where to where the fraction varies from mask to mask, instead of that
                of `mask`.
            withhold: share of the classes to withhold; above 0 some rooms were searched, see
                `bsg_models.inputs.search_masks`.
            fold: to test on, in a dataset of folds.
            edges: of the graphs.
            vocabulary: categories of `others`.
        """
        data = path if isinstance(path, Buildings) else open_dataset(path)
        scenes = data.scenes_of(part, fold=fold)
        masked = [
            _sample_masked(data, scene, one, draw, vocabulary, withhold)
            for scene, one in zip(scenes, _vary(mask, fractions, draw, len(scenes)), strict=True)
        ]
        return cls(masked, edges=edges, adjacency=data.adjacency)

    def len(self) -> int:
        """Return the number of masked buildings."""
        return len(self.masked)

    def get(self, idx: int) -> Data:
        """Return one masked building as a graph."""
        one = self.masked[idx]
        nodes = len(one.inputs)
        return Data(
            x=torch.from_numpy(one.inputs.astype(np.float32)),
            y=torch.from_numpy(one.targets.astype(np.float32)),
            edge_index=self._edges_of(one.scene_id, nodes, self._edges),
            adjacent_index=self._edges_of(one.scene_id, nodes, ("adjacent",)),
            is_building=torch.arange(nodes) == 0,
            others=torch.from_numpy(one.others.astype(np.float32)),
            visited=torch.from_numpy(one.visited.copy()),
            fraction=torch.from_numpy(one.share.astype(np.float32)),
            withheld=torch.from_numpy(one.withheld),
            scene_id=one.scene_id,
            draw=one.draw,
        )

    def _edges_of(self, scene_id: str, nodes: int, edges: tuple[EdgeSet, ...]) -> torch.Tensor:
        return _connect_once(nodes, edges, tuple(self._adjacency.get(scene_id, ())))


def reconnect(graphs: Data, edges: tuple[EdgeSet, ...]) -> Data:
    """Return a graph, or a batch of graphs, with other edges; see `connect`."""
    first = torch.nonzero(graphs.is_building)[:, 0].tolist()
    ends = [*first[1:], len(graphs.is_building)]
    inside = tuple(kind for kind in edges if kind != "adjacent")
    parts = [
        start + _connect_once(end - start, inside, ())
        for start, end in zip(first, ends, strict=True)
    ]
    if "adjacent" in edges:
        parts.append(graphs.adjacent_index)
    connected = graphs.clone()
    source, target = torch.cat(parts, dim=1)
    nodes = len(graphs.is_building)
    both = torch.unique(source * nodes + target)  # sorted, and far faster than unique columns
    connected.edge_index = torch.stack([both // nodes, both % nodes])
    return connected


@lru_cache(maxsize=4096)
def _connect_once(
    nodes: int, edges: tuple[EdgeSet, ...], adjacent: tuple[tuple[int, int], ...]
) -> torch.Tensor:
    return connect(nodes, edges, adjacent=adjacent)


def connect(
    nodes: int, edges: Sequence[EdgeSet], *, adjacent: Sequence[tuple[int, int]] = ()
) -> torch.Tensor:
    """Return directed edges `[2, E]` among the building (0) and its rooms, sorted.

    Args:
        nodes: N = 1 + R.
        edges: `up` rooms → building, `down` building → rooms, `adjacent` both ways between rooms
            that are known to be adjacent, `complete` both ways between all rooms.
        adjacent: pairs of rooms.
    """
    rooms = range(1, nodes)
    chosen: set[tuple[int, int]] = set()
    if "up" in edges:
        chosen |= {(room, 0) for room in rooms}
    if "down" in edges:
        chosen |= {(0, room) for room in rooms}
    if "adjacent" in edges:
        chosen |= {pair for a, b in adjacent for pair in ((a, b), (b, a))}
    if "complete" in edges:
        chosen |= {(a, b) for a in rooms for b in rooms if a != b}
    return torch.tensor(sorted(chosen), dtype=torch.long).reshape(-1, 2).T.contiguous()


def _vary(
    mask: MaskRecipe, fractions: tuple[float, float] | None, draw: int, buildings: int
) -> list[MaskRecipe]:
    """Return the mask of every building, in their order; fractions that vary are in hundredths."""
    if fractions is None:
        return [mask] * buildings
    rng = np.random.Generator(np.random.PCG64(np.random.SeedSequence([mask.seed, draw])))
    drawn = rng.uniform(*fractions, size=buildings).round(2).clip(*fractions).tolist()
    return [mask.model_copy(update={"fraction": fraction}) for fraction in drawn]


def _sample_masked(
    data: Buildings,
    scene: str,
    mask: MaskRecipe,
    draw: int,
    vocabulary: tuple[str, ...],
    withhold: float,
) -> MaskedBuilding:
    cells = data.cells[scene]
    adjacent = data.adjacency.get(scene, [])
    visited = sample_visited(cells, mask, scene_id=scene, draw=draw, adjacent=adjacent)
    hidden = sample_hidden(cells, visited, mask, scene_id=scene, draw=draw)
    searched, withheld = np.zeros(len(cells), dtype=bool), np.zeros(cells.shape, dtype=bool)
    inputs, share = to_histograms(cells - hidden), share_hidden(visited, mask)
    if withhold:
        searched, classes = sample_search(
            mask, scene_id=scene, draw=draw, shape=cells.shape, withhold=withhold
        )
        view = view_search(
            cells,
            cells - hidden,
            searched=searched[None],
            withheld=classes[None],
            fraction=mask.fraction,
        )
        inputs, share, withheld = view.inputs[0], view.share[0], view.withheld[0]
    return MaskedBuilding(
        scene_id=scene,
        draw=draw,
        inputs=inputs,
        targets=to_histograms(cells),
        visited=visited,
        share=share,
        others=see_others(data, scene, mask, draw, visited, vocabulary, searched=searched),
        withheld=withheld,
    )


def see_others(
    data: Buildings,
    scene: str,
    mask: MaskRecipe,
    draw: int,
    visited: npt.NDArray[np.bool_],
    vocabulary: tuple[str, ...],
    *,
    searched: npt.NDArray[np.bool_] | None = None,
) -> Counts:
    """Return the visible objects outside the classes, `[1 + R, V]`, row 0 the building.

    Of rooms that were `searched` `[1 + R]` all are visible.

    All of them are drawn, whatever the vocabulary, so that a mask does not depend on it.
    """
    others = data.others[scene]
    found = np.zeros((len(visited), len(vocabulary)), dtype=np.int64)
    if not vocabulary:
        return found
    hidden = sample_hidden(
        others.cells, visited, mask, scene_id=scene, draw=draw, part="unclassified"
    )
    if searched is not None:
        hidden[searched] = 0
    columns = _place_once(others.categories, vocabulary)
    found[:, columns[columns >= 0]] = to_histograms(others.cells - hidden)[:, columns >= 0]
    return found


@lru_cache(maxsize=4096)
def _place_once(categories: tuple[str, ...], vocabulary: tuple[str, ...]) -> npt.NDArray[np.int64]:
    return place_columns(categories, vocabulary)


@lru_cache(maxsize=32)
def _read_masked(
    path: Path, split: str, sha256: str, vocabulary: tuple[str, ...]
) -> tuple[MaskedBuilding, ...]:
    """Read the pairs of one split; `sha256` of the manifest makes a changed dataset another key."""
    data = open_dataset(path)
    recipe = data.manifest.pairs
    table = read_pairs(path, split)
    if recipe is None:
        raise DatasetError(f"{path}: has no pairs; run `bsg-data pairs` first")
    inputs, targets = histogram_column(table, "input"), histogram_column(table, "target")
    visited = table["visited"].to_numpy()
    starts = np.flatnonzero(table["node_index"].to_numpy() == 0)
    scenes = table["scene_id"].take(starts).to_pylist()
    draws = table["draw"].take(starts).to_pylist()
    ends = [*starts[1:], len(table)]
    return tuple(
        MaskedBuilding(
            scene_id=scene,
            draw=draw,
            inputs=inputs[a:b],
            targets=targets[a:b],
            visited=visited[a:b],
            share=share_hidden(visited[a:b], recipe.mask),
            others=see_others(data, scene, recipe.mask, draw, visited[a:b], vocabulary),
            withheld=np.zeros((b - a, inputs.shape[1]), dtype=bool),
        )
        for scene, draw, a, b in zip(scenes, draws, starts, ends, strict=True)
    )
