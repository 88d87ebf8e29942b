"""Choose a kept search, and prepare it for a page or an animation; it is not run again."""

from __future__ import annotations

from collections.abc import Sequence

from bsg_data.dataset.dataset import Dataset
from bsg_models.rendering.plan import KnownOutline, draw_plan, outline_room
from bsg_models.rendering.replay import Replay, Walk
from bsg_models.search.room_graphs import MEASURED
from bsg_models.studies.kept_searches import LEAST_ENTERED, MOST_HOLDING, TYPICAL, KeptSearch
from bsg_models.studies.savings import WorldResult
from bsg_models.studies.search_study import Study

_NAMED = "This search was named by its number, so it need not be typical."
_NOT_EVENTFUL = (
    "This search was chosen as worth watching, but no search met the rule: artifacts are in many "
    "rooms, or a robot finds one within a few rooms. Its saving is near that of all searches, and "
    "beliefs change much in it."
)
_EVENTFUL = (
    "This search was chosen as worth watching, by a rule. "
    f"At most {100 * MOST_HOLDING:.0f} % of the rooms hold what is sought, and every robot enters "
    f"at least {LEAST_ENTERED} rooms. The saving is within {100 * TYPICAL:.0f} points of that of "
    "all searches, or as near as there is. Among such searches, this one changes beliefs most."
)


def replay_search(
    data: Dataset,
    study: Study,
    results: Sequence[WorldResult],
    *,
    model: str | None,
    named: bool,
) -> Replay:
    """Return a kept search stop by stop, with the means over all searches of the study.

    Its costs are in metres if there is such a search. Of searches that were `named` by number, the
    first building's is shown. `model` is that whose beliefs the study used.
    """
    world = min((one.world for one in study.kept), key=lambda name: name not in MEASURED)
    there = [one for one in study.kept if one.world == world]
    result = next(one for one in results if (one.world, one.task) == (world, there[0].task))
    typical = result.savings[there[0].planner].saved.value
    kept = there[0] if named else choose_shown(there, typical)
    graphs = data.read_graphs()
    graph = next(one for one in graphs if one.scene_id == kept.scene_id)
    walks = []
    for planner, stops in kept.walks.items():
        saving = result.savings[planner]
        walks.append(
            Walk(
                planner=planner,
                model=model if study.planners[planner].reads == "belief" else None,
                stops=stops,
                mean_cost=saving.cost,
                mean_entered=saving.entered,
                mean_saved=saving.saved,
            )
        )
    measured = kept.world in MEASURED
    return Replay(
        scene_id=kept.scene_id,
        episode=kept.episode,
        artifacts=kept.artifacts,
        task=kept.task,
        world=kept.world,
        unit="m" if measured else "",
        plan=draw_plan(
            [
                KnownOutline(
                    room.room_index,
                    room.source_label or room.label or f"room {room.region_id}",
                    outline_room(room, room.centroid),
                    room.floor_index,
                )
                for room in graph.rooms
                if room.room_index in kept.rooms
            ]
        ),
        doors=tuple(
            (edge.source, edge.target)
            for edge in graph.adjacency
            if measured and {edge.source, edge.target} <= set(kept.rooms)
        ),
        holds=kept.holds,
        left_out=len(graph.rooms) - len(kept.rooms),
        walks=tuple(walks),
        searches=result.searches,
        buildings=result.buildings,
        chosen=_NAMED if named else _EVENTFUL if kept.eventful else _NOT_EVENTFUL,
    )


def choose_shown(kept: Sequence[KeptSearch], saved: float) -> KeptSearch:
    """Return the search to show: eventful, then typical, then with the most change of beliefs.

    `saved` is the saving of all searches together.
    """

    def rank(one: KeptSearch) -> tuple[bool, float, float]:
        return not one.eventful, max(0.0, abs(one.saved - saved) - TYPICAL), -one.change

    return min(kept, key=rank)
