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

from bsg_data.errors import DatasetError
from bsg_data.histograms import Counts, read_adjacency, read_cells, to_histograms
from bsg_data.manifest import Manifest, hash_manifest, read_manifest
from bsg_data.masks import draw_hidden, draw_visited
from bsg_data.pairs import histogram_column, read_pairs
from bsg_data.recipes import MaskRecipe
from bsg_data.shards import describe_file
from bsg_data.splits import read_splits

EdgeSet = Literal["up", "down", "adjacent", "complete"]
Part = Literal["train", "val", "test"]


@dataclass(frozen=True, eq=False)
class Buildings:
    """An opened dataset.

    Attributes:
        path: its folder.
        manifest: what it says of itself.
        sha256: of the manifest.
        cells: scene id → `[1 + R, C]`.
        adjacency: scene id → pairs of adjacent rooms.
        splits: split or fold → scene ids; empty before `bsg-data split`.
    """

    path: Path
    manifest: Manifest
    sha256: str
    cells: dict[str, Counts]
    adjacency: dict[str, list[tuple[int, int]]]
    splits: dict[str, tuple[str, ...]]

    def names_of(self, part: Part, *, fold: int | None = None) -> tuple[str, ...]:
        """Return the splits that make up train, val or test.

        Args:
            part: which.
            fold: with a dataset of K folds, test is this one, val the next, train the others.

        Raises:
            DatasetError: if the dataset is not split that way, or the part is empty.
        """
        names = tuple(self.splits)
        if not names:
            raise DatasetError(f"{self.path}: is not split yet; run `bsg-data split` first")
        folds = len(names) if names[0].startswith("fold-") else 0
        if folds and fold is None:
            raise DatasetError(
                f"{self.path}: is split into {folds} folds; say which one to test on (data.fold)"
            )
        if fold is not None and not 0 <= fold < folds:
            raise DatasetError(f"{self.path}: has {folds or 'no'} folds; there is no fold {fold}")
        chosen: tuple[str, ...]
        if fold is None:
            chosen = tuple(name for name in names if name == str(part))
        else:
            test, val = f"fold-{fold}", f"fold-{(fold + 1) % folds}"
            rest = tuple(name for name in names if name not in (test, val))
            chosen = {"test": (test,), "val": (val,), "train": rest}[part]
        if not chosen:
            raise DatasetError(f"{self.path}: its {part} split is empty; split it in another way")
        return chosen

    def scenes_of(self, part: Part, *, fold: int | None = None) -> tuple[str, ...]:
        """Return the scene ids of train, val or test."""
        names = self.names_of(part, fold=fold)
        return tuple(scene for name in names for scene in self.splits[name])


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
    """

    scene_id: str
    draw: int
    inputs: npt.NDArray[np.integer]
    targets: npt.NDArray[np.integer]
    visited: npt.NDArray[np.bool_]


class MaskedGraphs(Dataset):  # type: ignore[misc]
    """Masked buildings of one split as `torch_geometric.data.Data`.

    Each graph has `x` `[N, C]` input and `y` `[N, C]` target histograms (float), `edge_index`
    `[2, E]`, `is_building` `[N]`, `visited` `[N]`, `fraction` `[N]` (the share that the mask
    hides), and `scene_id` and `draw`.

    Example:
        >>> graphs = MaskedGraphs.stored(Path("dataset"), "train")  # doctest: +SKIP
        >>> graphs[0].x.shape  # doctest: +SKIP
        torch.Size([15, 45])
    """

    def __init__(
        self,
        masked: Sequence[MaskedBuilding],
        *,
        fraction: float,
        edges: Sequence[EdgeSet] = ("up", "down"),
        adjacency: dict[str, list[tuple[int, int]]] | None = None,
    ) -> None:
        super().__init__()
        self.masked = tuple(masked)
        self.fraction = fraction
        self._adjacency = adjacency or {}
        self._edges = tuple(edges)

    @classmethod
    def stored(
        cls,
        path: Path | Buildings,
        part: Part,
        *,
        fold: int | None = None,
        edges: Sequence[EdgeSet] = ("up", "down"),
    ) -> MaskedGraphs:
        """Read the stored pairs of a split, of a dataset's folder or of one that is open.

        Raises:
            DatasetError: if there are none.
        """
        data = path if isinstance(path, Buildings) else open_dataset(path)
        recipe = data.manifest.pairs
        names = data.names_of(part, fold=fold)
        masked = [m for name in names for m in _read_masked(data.path, name, data.sha256)]
        return cls(
            masked,
            fraction=recipe.mask.fraction if recipe else 0.0,
            edges=edges,
            adjacency=data.adjacency,
        )

    @classmethod
    def fresh(
        cls,
        path: Path | Buildings,
        part: Part,
        *,
        mask: MaskRecipe,
        draw: int,
        fold: int | None = None,
        edges: Sequence[EdgeSet] = ("up", "down"),
    ) -> MaskedGraphs:
        """Draw mask number `draw` of every building of a split, of a folder or an open dataset."""
        data = path if isinstance(path, Buildings) else open_dataset(path)
        masked = [
            _draw_masked(data, scene, mask, draw) for scene in data.scenes_of(part, fold=fold)
        ]
        return cls(masked, fraction=mask.fraction, edges=edges, adjacency=data.adjacency)

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
            edge_index=self._edges_of(one.scene_id, nodes),
            is_building=torch.arange(nodes) == 0,
            visited=torch.from_numpy(one.visited.copy()),
            fraction=torch.full((nodes,), self.fraction),
            scene_id=one.scene_id,
            draw=one.draw,
        )

    def _edges_of(self, scene_id: str, nodes: int) -> torch.Tensor:
        return _connect_once(nodes, self._edges, tuple(self._adjacency.get(scene_id, ())))


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


def _draw_masked(data: Buildings, scene: str, mask: MaskRecipe, draw: int) -> MaskedBuilding:
    cells = data.cells[scene]
    adjacent = data.adjacency.get(scene, [])
    visited = draw_visited(cells, mask, scene_id=scene, draw=draw, adjacent=adjacent)
    hidden = draw_hidden(cells, visited, mask, scene_id=scene, draw=draw)
    return MaskedBuilding(scene, draw, to_histograms(cells - hidden), to_histograms(cells), visited)


@lru_cache(maxsize=16)
def _read_masked(path: Path, split: str, sha256: str) -> tuple[MaskedBuilding, ...]:
    """Read the pairs of one split; `sha256` of the manifest makes a changed dataset another key."""
    table = read_pairs(path, split)
    inputs, targets = histogram_column(table, "input"), histogram_column(table, "target")
    visited = table["visited"].to_numpy()
    starts = np.flatnonzero(table["node_index"].to_numpy() == 0)
    scenes = table["scene_id"].take(starts).to_pylist()
    draws = table["draw"].take(starts).to_pylist()
    ends = [*starts[1:], len(table)]
    return tuple(
        MaskedBuilding(scene, draw, inputs[a:b], targets[a:b], visited[a:b])
        for scene, draw, a, b in zip(scenes, draws, starts, ends, strict=True)
    )
