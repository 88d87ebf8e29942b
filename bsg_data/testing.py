"""Contract tests for your own sources and masks.

Subclass a contract, name a row of the registry, and run pytest (docs/extending.md). The rows of
this project pass the same contracts.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from itertools import product
from multiprocessing.reduction import ForkingPickler
from pathlib import Path
from typing import ClassVar

import numpy as np

from bsg_data.arrays import Counts
from bsg_data.build import build_dataset
from bsg_data.checks.dataset import check_dataset
from bsg_data.checks.graphs import find_faults
from bsg_data.dataset.manifest import CARD, CROISSANT
from bsg_data.dataset.scenes import make_tables
from bsg_data.dataset.splits import split_dataset
from bsg_data.errors import SourceError
from bsg_data.observation.mask_streams import MaskStreams
from bsg_data.observation.masks import Layout, sample_masks
from bsg_data.observation.pairs import write_pairs
from bsg_data.observation.view import View
from bsg_data.recipes import MaskRecipe, PairsRecipe, SplitRecipe
from bsg_data.scene.class_map import load_class_map
from bsg_data.scene.connections import NO_CONNECTIONS, Connections
from bsg_data.scene.scene_graph import is_scene_id
from bsg_data.sources.catalogue import SOURCES, open_source
from bsg_data.sources.hm3d import HEADER, HM3DFolder

_KITCHEN = ("wall", "stove", "refrigerator", "sink", "kitchen cabinet", "chair", "chair")
_BEDROOM = ("wall", "bed", "pillow", "pillow", "wardrobe", "lamp", "curtain", "zzqx thing")
_BATHROOM = ("wall", "toilet", "sink", "mirror", "bathtub", "towel", "unknown")


def write_example_dataset(folder: Path, *, mask: MaskRecipe | None = None) -> Path:
    """Write a dataset of twelve small buildings, split and with two draws of pairs.

    Args:
        folder: to which its source and the dataset are written.
        mask: of the pairs; None for the paper's.

    Returns:
        the dataset.
    """
    for number in range(12):
        rooms = [_KITCHEN, _BATHROOM, *[_BEDROOM] * (number % 6)]
        named = [(name, room) for room, names in enumerate(rooms) for name in names]
        lines = [f'{i},{i * 4099:06X},"{name}",{room}' for i, (name, room) in enumerate(named, 1)]
        building = f"{number:05d}-example{number:04d}"
        path = folder / "source" / "train" / building / f"example{number:04d}.semantic.txt"
        path.parent.mkdir(parents=True)
        path.write_text("\n".join([HEADER, *lines]) + "\n", "utf-8")
    dataset = folder / "dataset"
    build_dataset(HM3DFolder(folder / "source"), dataset)
    split_dataset(dataset, SplitRecipe())
    write_pairs(dataset, PairsRecipe(mask=mask or MaskRecipe(), draws=2))
    return dataset


class SourceContract:
    """Tests that every source must pass.

    Attributes:
        name: of its row, or of its entry point.
    """

    name: ClassVar[str]

    def write_example(self, folder: Path) -> Path:
        """Write what the source reads, of two buildings or more, and return the path to open."""
        raise NotImplementedError("write an example that the source reads")

    def test_scenes_are_sorted_and_each_building_is_there_once(self, tmp_path: Path) -> None:
        """Find scenes by id, and the same ones again."""
        source = open_source(self.name, self.write_example(tmp_path))
        scenes = source.find().scenes
        ids = [ref.scene_id for ref in scenes]
        assert len(ids) >= 2, "the example has two buildings or more"
        assert ids == sorted(set(ids))
        assert len({ref.key for ref in scenes}) == len(scenes)
        assert all(is_scene_id(scene_id) for scene_id in ids)
        assert source.find().scenes == scenes

    def test_reading_is_deterministic_and_works_in_another_process(self, tmp_path: Path) -> None:
        """Read every scene twice, the second time by a source that was sent to a worker."""
        source = open_source(self.name, self.write_example(tmp_path))
        sent = ForkingPickler.loads(ForkingPickler.dumps(source))
        class_map = load_class_map()
        for ref in source.find().scenes:
            assert sent.read(ref, class_map) == source.read(ref, class_map)

    def test_graphs_are_whole(self, tmp_path: Path) -> None:
        """Read graphs that keep the rules of `bsg-data check`."""
        source = open_source(self.name, self.write_example(tmp_path))
        for ref in source.find().scenes:
            graph = source.read(ref, load_class_map()).graph
            assert graph.scene_id == ref.scene_id
            assert graph.source == source.kind
            tables = make_tables([graph], load_class_map().classes)
            assert list(find_faults(tables)) == []

    def test_a_dataset_of_it_is_sound_and_under_its_own_terms(self, tmp_path: Path) -> None:
        """Build a dataset, which `bsg-data check` finds nothing wrong with."""
        (tmp_path / "example").mkdir()
        source = open_source(self.name, self.write_example(tmp_path / "example"))
        out = tmp_path / "dataset"
        manifest = build_dataset(source, out)
        assert manifest.totals.scenes == len(source.find().scenes)
        assert check_dataset(out) == ()
        terms = SOURCES[source.kind].terms
        card = (out / CARD).read_text("utf-8")
        described = json.loads((out / CROISSANT).read_text("utf-8"))
        if terms is None:
            assert "license: unknown" in card
            assert "unknown" in described["license"]
            return
        assert terms.sentence in card
        values = [described[key] for key in ("license", "url", "citeAs")]
        assert values == [terms.licence_url, terms.homepage, terms.citation]

    def test_what_is_not_there_is_a_source_error(self, tmp_path: Path) -> None:
        """Refuse a path where nothing is."""
        import pytest  # Imported here because only tests have it.

        with pytest.raises(SourceError):
            open_source(self.name, tmp_path / "nothing here").find()


class MaskContract:
    """Tests that every mask must pass.

    Attributes:
        name: of its row, or of its entry point.
    """

    name: ClassVar[str]

    def cases(self) -> Iterator[tuple[Counts, MaskRecipe, Connections]]:
        """Yield buildings `[1 + R, C]` of many kinds, with recipes and with what connects."""
        rng = np.random.default_rng(0)
        row = Connections.of_pairs([(1, 2), (2, 3)])
        for fraction in (0.0, 0.29, 0.5, 1.0):
            recipe = MaskRecipe(strategy=self.name, fraction=fraction, seed=7)
            for nodes in (1, 2, 4, 12):
                yield rng.integers(0, 6, (nodes, 5)), recipe, NO_CONNECTIONS
            yield np.zeros((4, 3), dtype=np.int64), recipe, NO_CONNECTIONS  # nothing to hide
            yield np.full((4, 3), 9), recipe, row
            yield np.full((4, 3), 9), recipe.model_copy(update={"withhold": 0.5}), row

    def test_views_are_sound_and_hide_what_they_say(self) -> None:
        """Tell a share from 0 to 1 of every node, and of the building the mean of its rooms'.

        Where the share is 1 all is hidden, where it is 0 nothing. No array of the caller changes.
        """
        for (building, recipe, connections), draw in product(self.cases(), range(3)):
            before = building.copy()
            view, cells, hidden = draw_mask(building, recipe, draw=draw, connections=connections)
            assert (building == before).all()
            assert view.nodes[-1] < len(building)
            require_sound(view, cells, hidden)

    def test_what_is_told_is_true_in_the_mean(self) -> None:
        """Hide, over many draws, as many objects as the shares say, to a hundredth of them.

        That is beyond three standard errors of the simulation, which are less than half a hundredth
        each. Of the building, of the rooms that were entered and of those that were not. Where
        rooms connect the building is left out: how full the rooms in the middle of a building are
        is no matter of the mask.
        """
        sizes = np.array([2, 3, 6, 9, 4, 12, 5, 15, 8])
        cells = np.random.default_rng(1).poisson(np.tile(sizes[:, None], 5))
        row = Connections.of_pairs([(room, room + 1) for room in range(1, len(cells) - 1)])
        for fraction, connections in product((0.1, 0.5, 0.9), (NO_CONNECTIONS, row)):
            recipe = MaskRecipe(strategy=self.name, fraction=fraction, seed=7)
            wrong = [_count_wrong(cells, recipe, draw, connections) for draw in range(_DRAWS)]
            errors = np.array(wrong)[:, 1 if len(connections) else 0 :] / cells.sum()
            deviation = errors.std(axis=0) / np.sqrt(_DRAWS)
            assert (deviation < _TOLERANCE / 2).all()
            assert (np.abs(errors.mean(axis=0)) < _TOLERANCE + 3 * deviation).all()

    def test_a_mask_depends_on_recipe_scene_and_draw_alone(self) -> None:
        """Draw the same mask again after others, and in another order."""
        recipe = MaskRecipe(strategy=self.name, fraction=0.5, seed=3, withhold=0.3)

        def sample(key: tuple[str, int]) -> tuple[bytes, ...]:
            view, _, hidden = draw_mask(np.full((8, 4), 5), recipe, scene_id=key[0], draw=key[1])
            arrays = (view.nodes, view.visited, view.hidden_share, view.withheld, hidden)
            return tuple(array.tobytes() for array in arrays)

        keys = list(product("ab", range(3)))
        first = {key: sample(key) for key in keys}
        assert {key: sample(key) for key in reversed(keys)} == first

    def test_pairs_of_it_are_sound(self, tmp_path: Path) -> None:
        """Write pairs, which `bsg-data check` finds nothing wrong with."""
        recipe = MaskRecipe(strategy=self.name)
        assert check_dataset(write_example_dataset(tmp_path, mask=recipe)) == ()


_TOLERANCE = 0.01  # of the objects of a building
_DRAWS = 600


def draw_mask(
    cells: Counts,
    recipe: MaskRecipe,
    *,
    scene_id: str = "s",
    draw: int = 0,
    connections: Connections = NO_CONNECTIONS,
) -> tuple[View, Counts, Counts]:
    """Return a view, the cells in the robot's graph `[N, C]`, and what is hidden of them."""
    streams = MaskStreams([recipe], [scene_id], [draw])
    layout = Layout(cells.shape, connections)
    (view,), present, hidden = sample_masks([cells], [layout], streams)
    return view, present, hidden


def require_sound(view: View, cells: Counts, hidden: Counts) -> None:
    """Refuse a view of cells `[N, C]` that cannot be, or that hides other than it says."""
    share, withheld = view.hidden_share, view.withheld
    assert view.nodes[0] == 0, "the building is in the robot's graph"
    assert (np.diff(view.nodes) > 0).all()
    assert view.visited.shape == share.shape == (len(cells),)
    assert withheld.shape == cells.shape
    assert view.visited.dtype == withheld.dtype == bool
    assert view.visited[0], "the robot is in the building"
    assert ((share >= 0) & (share <= 1)).all()
    assert len(share) == 1 or np.isclose(share[0], share[1:].mean())
    assert ((hidden >= 0) & (hidden <= cells)).all()
    assert (hidden == cells)[(share == 1)[:, None] | withheld].all()
    assert (hidden[(share == 0)[:, None] & ~withheld] == 0).all()


def _count_wrong(
    cells: Counts, recipe: MaskRecipe, draw: int, connections: Connections
) -> tuple[float, float, float]:
    """Return how many more objects are hidden than is told.

    Of the building, the rooms that were entered, and those that were not.
    """
    view, found, hidden = draw_mask(cells, recipe, draw=draw, connections=connections)
    present, gone = found.sum(axis=1), hidden.sum(axis=1)
    wrong = gone - view.hidden_share * present
    rooms = view.nodes > 0
    return (
        float(gone.sum() - view.hidden_share[0] * present.sum()),
        float(wrong[view.visited & rooms].sum()),
        float(wrong[~view.visited].sum()),
    )
