"""What a robot has seen: by hand, by masks, and room after room."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from one_building import same_surroundings, surround_rooms
from refusals import refuses

from bsg_data.errors import RecipeError
from bsg_data.scene.class_space import load_class_space
from bsg_models.belief.hidden_share import VAGUE, ShareBelief
from bsg_models.belief.partial_graph import (
    MOST_HIDDEN,
    KnownRoom,
    PartialGraph,
    SeenObject,
)
from bsg_robot.graph.reports import (
    enter,
    find_all,
    see_object,
)

CLASS_SPACE = load_class_space()
CLASS = {name: number for number, name in enumerate(CLASS_SPACE.classes)}


def seen(name: str, room: int, category: str) -> SeenObject:
    return SeenObject(name, room, category, category, CLASS.get(category))


GRAPH = PartialGraph(
    "home",
    CLASS_SPACE,
    0.5,
    (KnownRoom("a", 0.5), KnownRoom("b", 1.0, visited=False)),
    (seen("1", 1, "bed"), seen("2", 1, "bed"), seen("3", 1, "tap"), seen("4", 0, "book")),
    ((1, 2),),
)


def test_an_observation_by_hand() -> None:
    seen = GRAPH.observation(vocabulary=("drawer", "tap"), withheld=[CLASS["sink"]])
    assert seen.scene_ids == ("home",)
    assert seen.starts.tolist() == [0, 3]
    np.testing.assert_array_equal(seen.inputs, GRAPH.histograms())
    assert seen.unclassified.tolist() == [[0, 1], [0, 1], [0, 0]]
    assert seen.vocabulary == ("drawer", "tap")
    assert seen.hidden_share.tolist() == [0.5, 0.5, 1.0]
    assert seen.visited.tolist() == [True, True, False]
    assert seen.withheld[:, CLASS["sink"]].all()
    assert seen.withheld.sum() == 3
    assert seen.connections.pairs.tolist() == [[1, 2]]
    assert seen.connections.methods.tolist() == ["given"]
    assert np.isnan(seen.connections.lengths).all()
    plain = GRAPH.observation()
    assert plain.unclassified.shape == (3, 0)
    assert not plain.withheld.any()


def test_the_surroundings_of_a_graph_by_hand() -> None:
    one = replace(GRAPH.rooms[0], room_type={"kitchen": 1.0}, footprint=((0, 0), (4, 0), (0, 2)))
    graph = replace(GRAPH, rooms=(one, GRAPH.rooms[1]), building_kind="school", source="behavior")
    expected = surround_rooms(
        [4, None], ["kitchen", None], building_kind="school", source="behavior"
    )
    assert same_surroundings(graph.observation().surroundings, expected)
    searched = find_all(graph, 1, [])
    assert same_surroundings(searched.observation().surroundings, expected)


def test_what_is_withheld_may_be_said_by_node_and_class() -> None:
    where = np.zeros((3, 45), dtype=bool)
    where[2, CLASS["sink"]] = True
    assert GRAPH.observation(withheld=where).withheld.tolist() == where.tolist()
    with refuses(RecipeError, "withheld-shape", where="home"):
        GRAPH.observation(withheld=where[1:])


def test_a_searched_room_hides_nothing() -> None:
    more = see_object(see_object(GRAPH, seen("5", 2, "sink")), seen("6", 2, "toilet"))
    after = find_all(more, 2, ["5", "6"])
    assert after.rooms[1] == replace(GRAPH.rooms[1], visited=True, hidden_share=0.0)
    assert after.hidden_share == pytest.approx(0.5 * 0.5 / 1.5)
    assert after.histograms()[2].sum() == 2
    assert after.histograms()[1].tolist() == GRAPH.histograms()[1].tolist()
    again = find_all(after, 2, ["5"])
    assert again.histograms()[2].sum() == 1  # what is seen now replaces what was
    bed = CLASS["bed"]  # withheld, but not where all was searched
    assert after.observation(withheld=[bed]).withheld[:, bed].tolist() == [True, True, False]
    both = find_all(after, 1, ["1"])
    assert both.hidden_share == 0
    assert not both.observation(withheld=[bed]).withheld.any()


def test_the_share_of_a_building_moves_with_its_rooms() -> None:
    assert GRAPH.share_with([0.5, 1.0]) == 0.5
    assert GRAPH.share_with([0.2, 1.0]) == pytest.approx(0.5 * 1.2 / 1.5)
    full = replace(GRAPH, hidden_share=0.9)
    assert full.share_with([1.0, 1.0]) == 1.0  # not 1.2
    known = replace(GRAPH, hidden_share=0.0, rooms=(KnownRoom("a", 0.0), KnownRoom("b", 0.0)))
    assert known.share_with([0.0, 0.0]) == 0
    assert known.share_with([1.0, 0.0]) == 0.5


def test_a_room_that_shows_something_does_not_hide_all() -> None:
    graph = see_object(GRAPH, seen("sink", 2, "sink"))
    assert (graph.rooms[1].hidden_share, graph.rooms[1].visited) == (MOST_HIDDEN, False)
    assert graph.hidden_share == pytest.approx(0.5 * (0.5 + MOST_HIDDEN) / 1.5)
    rooms = tuple(replace(room, hidden_share=1.0) for room in GRAPH.rooms)
    all_hidden = replace(GRAPH, hidden_share=1.0, rooms=rooms)
    assert [room.hidden_share for room in all_hidden.rooms] == [MOST_HIDDEN, 1.0]
    assert all_hidden.hidden_share == MOST_HIDDEN
    assert enter(GRAPH, 1, hidden_share=ShareBelief(1.0)).rooms[0].hidden_share == MOST_HIDDEN
    doubted = see_object(GRAPH, replace(seen("sink", 2, "sink"), score=0.1))
    assert doubted.rooms == GRAPH.rooms, "it is hardly there"


@pytest.mark.parametrize(
    ("before", "said", "after"),
    [(1.0, None, VAGUE.mean), (0.2, None, 0.2), (0.2, 0.7, 0.7), (0.9, 0.0, 0.0)],
)
def test_entering_a_room_tells_what_it_hides(
    before: float, said: float | None, after: float
) -> None:
    rooms = (KnownRoom("a", before, visited=before < 1), GRAPH.rooms[1])
    graph = replace(GRAPH, rooms=rooms, objects=(), hidden_share=(before + 1) / 2)
    graph = enter(graph, 1, hidden_share=None if said is None else ShareBelief(said))
    assert (graph.rooms[0].visited, graph.rooms[0].hidden_share) == (True, after)
    assert graph.hidden_share == pytest.approx((after + 1) / 2)


def test_models_read_what_is_probably_there() -> None:
    before = GRAPH.histograms()[:, CLASS["sink"]].tolist()
    for score, more in ((0.5, 1), (0.49, 0), (None, 1)):
        graph = see_object(GRAPH, replace(seen("x", 1, "sink"), score=score))
        assert graph.histograms()[1, CLASS["sink"]] == before[1] + more
