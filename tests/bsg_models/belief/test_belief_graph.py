"""Blind nodes by hand and by property, and beliefs that improve as rooms are searched."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from refusals import refuses

from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.shards import read_scene_graphs
from bsg_data.errors import RecipeError
from bsg_data.observation.masked_buildings import sample_masked
from bsg_data.observation.masks import MASKS
from bsg_data.recipes import MaskRecipe
from bsg_data.scene.class_space import ClassSpace
from bsg_models.belief.belief_graph import believe, complete, rank_unseen
from bsg_models.belief.count_distribution import poisson
from bsg_models.belief.expectation import Expectation, from_totals
from bsg_models.belief.masked_graph import list_withheld, mask_scene
from bsg_models.belief.partial_graph import KnownRoom, PartialGraph, SeenObject
from bsg_models.inputs.folds import scenes_of

FOUR = ClassSpace.of("test", ("bed", "lamp", "sink", "tv"))
GRAPH = PartialGraph(
    "s",
    FOUR,
    0.5,
    (KnownRoom("a", 0.5), KnownRoom("b", 0.5)),
    (SeenObject("1", 1, "bed", "bed", 0), SeenObject("2", 2, "sink", "sink", 2)),
)


def test_remainders_are_shared_by_hand() -> None:
    # 2.6 objects are expected: 3 nodes. One lamp whole; the remainders .8 and .5 take the rest.
    assert complete(np.array([[0.8, 1.2, 0.1, 0.5]])).tolist() == [[1, 1, 0, 1]]
    # A tie goes to the lower index; a half is rounded up.
    assert complete(np.array([[0.25, 0.25, 0.0, 0.0]])).tolist() == [[1, 0, 0, 0]]
    assert complete(np.array([[0.2, 0.2, 0.0, 0.0]])).tolist() == [[0, 0, 0, 0]]


@given(arrays(np.float64, (3, 7), elements=st.floats(0, 30)))
def test_blind_nodes_complete_a_room_to_its_rounded_total(hidden: np.ndarray) -> None:
    numbers = complete(hidden)
    np.testing.assert_array_equal(numbers.sum(axis=1), np.floor(hidden.sum(axis=1) + 0.5))
    assert (numbers >= np.floor(hidden)).all()
    assert (numbers <= np.ceil(hidden)).all()


def test_a_belief_graph_by_hand() -> None:
    inputs = GRAPH.histograms().astype(float)
    hidden = np.array([[0.1, 2.0, 0.7, 0], [0.1, 1.4, 0.6, 0], [0, 0.6, 0.1, 0]])
    expectation = Expectation(inputs, poisson(hidden))
    belief = believe(GRAPH, expectation, model="by hand")
    found = [(node.room_index, node.class_index, node.expected) for node in belief.blind]
    assert found == [(1, 1, 1.4), (1, 2, 0.6), (2, 1, 0.6)]
    assert belief.blind[0].presence == pytest.approx(1 - np.exp(-1.4))
    np.testing.assert_allclose(belief.hidden, hidden)
    unseen = believe(GRAPH, expectation, mode="unseen", top=1)
    assert [(node.room_index, node.class_index) for node in unseen.blind] == [(1, 1), (2, 1)]
    # The sink of room 2 was seen, and a tv is certainly not there.
    assert [row.tolist() for row in rank_unseen(expectation, 9)] == [[1], [1, 2], [1]]


def test_the_expectation_of_another_graph_is_refused() -> None:
    with refuses(RecipeError, "expectation-foreign"):
        believe(GRAPH, from_totals(np.zeros((3, 4)), np.ones((3, 4))))


@pytest.mark.parametrize("strategy", MASKS.names())
def test_a_model_reads_a_partial_graph_as_it_reads_a_masked_building(
    dataset: Path, strategy: str
) -> None:
    recipe = MaskRecipe(strategy=strategy, fraction=0.6, seed=4, withhold=0.2, detector=1.0)
    data, vocabulary = Dataset.open(dataset), ("wall", "floor", "kitchen cabinet")
    space = data.manifest.class_space
    graphs = {graph.scene_id: graph for graph in read_scene_graphs(dataset)}
    scenes = scenes_of(data, "train")
    masked = sample_masked(data, scenes, mask=recipe, draw=1, vocabulary=vocabulary)
    assert len(masked) > 5
    for number, scene in enumerate(scenes):
        partial = mask_scene(graphs[scene], recipe, draw=1, class_space=space)
        withheld = list_withheld(recipe, partial, draw=1)
        ours = partial.observation(vocabulary=vocabulary, withheld=withheld)
        theirs = masked.seen.take([number])
        assert ours.scene_ids == theirs.scene_ids == (scene,)
        assert ours.vocabulary == theirs.vocabulary == vocabulary
        for name in ("starts", "inputs", "hidden_share", "visited", "withheld", "unclassified"):
            np.testing.assert_array_equal(getattr(ours, name), getattr(theirs, name), name)
        np.testing.assert_array_equal(ours.connections.pairs, theirs.connections.pairs)
        real = {str(obj.instance_id): obj.raw_category for obj in graphs[scene].objects}
        assert all(real[obj.name] == obj.raw_category for obj in partial.objects)


SEEN = np.array([[2.0, 0.0, 1.0]])


def test_totals_below_the_input_hide_nothing() -> None:
    found = from_totals(SEEN, np.array([[1.0, 3.0, 1.5]]))
    assert found.hidden.tolist() == [[0.0, 3.0, 0.5]]
    assert found.expected.tolist() == [[2.0, 3.0, 1.5]]
    assert found.totals.tolist() == [[1.0, 3.0, 1.5]]


def test_what_was_seen_is_below_every_quantile() -> None:
    found = Expectation(SEEN, poisson(np.array([[0.5, 3.0, 0.0]])))
    assert found.totals.tolist() == found.expected.tolist() == [[2.5, 3.0, 1.0]]
    assert found.quantile(0.0).tolist() == SEEN.tolist()
    assert found.quantile(0.5).tolist() == [[2.0, 3.0, 1.0]]
    assert found.quantile(0.95).tolist() == [[4.0, 6.0, 1.0]]
