"""Answer a robot's questions about one building.

    seen = open_graph("graph.json")
    seen.where("microwave")[0].room

All names are the robot's own: ids or labels of its rooms, and any word for a thing.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, overload

import numpy as np

from bsg_data.arrays import Bools, Floats
from bsg_data.errors import RecipeError
from bsg_data.files import AnyPath
from bsg_data.records import read_number
from bsg_data.sources.label_table import RoomWords
from bsg_data.words.shown import show_value
from bsg_models.belief.expectation import LEAST_PRESENCE, Expectation
from bsg_models.belief.partial_graph import LOOK_CHANCE
from bsg_models.runs.found_model import DEFAULT_MODEL
from bsg_models.runs.predictor import Predictor
from bsg_models.search.catalogue import PLANNERS, AnyPlanner, find_planner
from bsg_models.search.knowledge import Task
from bsg_models.search.planners import require_task
from bsg_robot.answers.decision import Decision, Plan, weigh
from bsg_robot.answers.destinations import (
    LOOK_AT,
    is_there,
    keep_likeliest,
    measure_spots,
    weigh_spots,
)
from bsg_robot.answers.nouns import looks_of, split_head
from bsg_robot.answers.place import (
    EXPLORE,
    NOT_FOUND,
    Destination,
    ExpectedClass,
    Habit,
    Piece,
    Place,
    RoomKind,
    Step,
)
from bsg_robot.answers.robot_map import RobotMap, alone
from bsg_robot.answers.thing_belief import ThingBelief
from bsg_robot.answers.ways import (
    AnyLook,
    Costs,
    Ways,
    add_places,
    check_costs,
    cost_looks,
    list_lost,
    measure_ways,
)
from bsg_robot.answers.words import Meaning, find_room
from bsg_robot.graph.graph_file import open_graph_file, parse_graph
from bsg_robot.graph.reports import reclassify
from bsg_robot.things.pieces import TIDY, find_pieces_of

if TYPE_CHECKING:
    from bsg_models.belief.belief_graph import BeliefGraph, Mode

_SHOWN_PIECES = 3  # of each room
_MOST, _SLOWEST = 1e9, 1e-6  # of a cost, a budget, a speed; and of a speed
_LEAST = 1e-12  # a smaller number is not divided by


def open_graph(
    graph: AnyPath | Mapping[str, Any],
    *,
    model: Predictor | AnyPath = DEFAULT_MODEL,
    labels: AnyPath | None = None,
    room_labels: RoomWords | None = None,
) -> SeenBuilding:
    """Open a robot's graph, to ask about it.

    Args:
        graph: file of a robot's graph, in this project's JSON or Spark-DSG's; `-` for standard
            input; or the document itself, as `json.loads` returns it.
        model: a `Predictor`, or what it takes.
        labels: label space of a Hydra graph, as `load_label_space` takes it.
        room_labels: CSV `source_label,label` of your words for rooms; they count before ours, and
            are kept with the graph.

    Raises:
        BSGError: if the graph cannot be read.
        CheckpointError: if there is no such model.
    """
    if isinstance(graph, Mapping):
        file = parse_graph(dict(graph), path=Path("graph"), labels=labels, room_labels=room_labels)
    else:
        file = open_graph_file(Path(graph), labels=labels, room_labels=room_labels)
    predictor = model if isinstance(model, Predictor) else Predictor(model)
    return SeenBuilding(reclassify(file.graph, predictor.class_map), predictor, notes=file.notes)


class _Search(NamedTuple):
    """How a robot searches: see `SeenBuilding.next_room`."""

    costs: Costs | None = None
    look: AnyLook | None = None
    chance: float = LOOK_CHANCE
    task: Task = "single"
    budget: float | None = None
    speed: float | None = None

    def check(self) -> None:
        """Refuse what is no task, chance, budget or speed."""
        require_task(self.task)
        if not read_number("chance", self.chance, most=1.0):
            raise RecipeError("chance: expected above 0, found 0", code="chance-zero")
        if self.budget is not None:
            read_number("budget", self.budget, most=_MOST)
        if self.speed is not None and read_number("speed", self.speed, most=_MOST) < _SLOWEST:
            raise RecipeError(
                f"speed: expected {_SLOWEST} or more, found {self.speed}", code="speed-zero"
            )

    def spend(self, ways: Ways) -> float | None:
        """Return the budget in the unit of the ways."""
        if self.budget is None or self.speed is None:
            return self.budget
        return self.budget * self.speed * ways.metre


class SeenBuilding(RobotMap):
    """What a robot has seen of one building; the robot reports to it and asks it.

    Reports change this object: `saw`, `gone`, `looked`, `entered`, `searched`, `discovered`,
    `describe`, `more_rooms`, `passes`, `keeps`, `never` and `forget`. Questions do not: `where`,
    `anywhere`, `habits`, `expected`, `kinds`, `next_room`, `next_rooms`, `explain` and `belief`.
    The state is one immutable `PartialGraph`. Keep `graph`, or a `copy`, to ask what-if questions.

    A thing is any word. A room is its id, or its label if no other room has it. What cannot be,
    such as a word that means no thing, a name that means no room, or a number out of its range,
    raises `RecipeError` and changes nothing. The object is thread-safe.
    """

    @overload
    def where(
        self, thing: str, *, here: str | None = ..., costs: Costs | None = ..., tidy: float = ...
    ) -> tuple[Place, ...]: ...

    @overload
    def where(self, thing: str, *, within: str, tidy: float = ...) -> tuple[Piece, ...]: ...

    def where(
        self,
        thing: str,
        *,
        here: str | None = None,
        costs: Costs | None = None,
        within: str | None = None,
        tidy: float = TIDY,
    ) -> tuple[Place, ...] | tuple[Piece, ...]:
        """Return where a thing is, the likeliest first: rooms, or pieces of furniture of one room.

        Rooms have their three likeliest pieces. Of a room, the last is any piece that was not seen
        yet; there are none for what stands by itself, such as a wardrobe. The formulas are in
        `bsg_robot.things.pieces`.

        Args:
            thing: any word; `understand` says which class answers it.
            here: the robot's room, from which costs are measured.
            costs: (room, room) → cost, replacing what the graph measures; ∞ closes a way.
            within: id or label of a room, to ask for its pieces of furniture.
            tidy: share of things that lie where they belong, 0 to 1; the others lie as in an untidy
                home.
        """
        tidy = read_number("tidy", tidy, most=1.0)
        with self._lock:
            if within is None:
                return self._list_rooms(thing, here, costs, tidy)
            node = find_room(self.graph, within)
            return self._now.list_pieces(self._now.seek(thing), node, tidy)

    def _list_rooms(
        self, thing: str, here: str | None, costs: Costs | None, tidy: float
    ) -> tuple[Place, ...]:
        sought, rooms = self._now.seek(thing), self.graph.rooms
        belief = sought.belief
        check_costs(self.graph, costs)  # what is said must be right, though it does not count
        known_costs = {} if here is None else self._known_costs(here, costs)
        anywhere = max(float(belief.probability[0]), _LEAST)
        likely, unseen, expected = (
            column.tolist() for column in (belief.probability, belief.never_seen, belief.expected)
        )
        places = [
            Place(
                room=room.name,
                label=room.label,
                probability=likely[node],
                if_there=min(1.0, likely[node] / anywhere),
                unseen=unseen[node],
                expected=expected[node],
                seen=tuple([obj.name for obj in belief.seen[node]]),
                cost=known_costs.get(node),
                kind=self._now.kinds.taken_for(node - 1),
                pieces=self._now.list_pieces(sought, node, tidy)[:_SHOWN_PIECES]
                if self._now.pieces_of(node).is_furnished
                else (),
            )
            for node, room in enumerate(rooms, 1)
        ]
        if belief.seen[0]:
            ids, present = tuple([obj.name for obj in belief.seen[0]]), is_there(belief.seen[0])
            places.append(
                Place(None, None, present, min(1.0, present / anywhere), 0.0, 0.0, ids, None)
            )
        if self._now.nodes > 1 + len(rooms):
            new = slice(len(rooms) + 1, None)
            present, more = belief.somewhere(new), float(belief.expected[new].sum())
            way = None if here is None else self.ways(costs).usual
            share = min(1.0, present / anywhere)
            places.append(Place(EXPLORE, NOT_FOUND, present, share, present, more, (), way))
        return tuple(
            sorted(places, key=lambda p: (-p.probability, math.inf if p.cost is None else p.cost))
        )

    @alone
    def anywhere(self, thing: str) -> float:
        """Return P(at least one is in the building, seen or not).

        It is never below that of the likeliest room.
        """
        return float(self._now.seek(thing).belief.probability[0])

    @alone
    def habits(self, thing: str) -> tuple[Habit, ...]:
        """Return what this home has taught of where a thing usually is, the likeliest first.

        There are at most 20, and the last, which has no room: it is the weight of what is known of
        all homes. There is none if this home has taught nothing of it. A place without sightings
        that nobody told is one of other things of its group, such as drinks.
        """
        meaning = self._now.seek(thing).meaning
        return self._now.home.list_habits(meaning) if self._now.is_taught else ()

    @alone
    def kinds(self, room: str) -> tuple[RoomKind, ...]:
        """Return the kinds that a room may be of, the likeliest first.

        They follow from its label and name, from what was seen in it, and from the other rooms.
        Those below one percent are left out.
        """
        found = self._now.kinds.said[find_room(self.graph, room) - 1]
        return tuple(RoomKind(kind, likely) for kind, likely in found)

    @alone
    def expected(self, room: str) -> tuple[ExpectedClass, ...]:
        """Return the unseen classes that a room may hold, the likeliest first.

        Classes below half a percent are left out.
        """
        node, belief = find_room(self.graph, room), self._now.expectation()
        presence = belief.presence[node]
        return tuple(
            ExpectedClass(
                name=self._words.own.classes[c],
                probability=float(presence[c]),
                expected=float(belief.hidden[node, c]),
                seen=int(belief.inputs[node, c]),
            )
            for c in np.argsort(-presence, kind="stable")
            if presence[c] >= LEAST_PRESENCE
        )

    @alone
    def next_room(
        self,
        things: str | Sequence[str],
        *,
        here: str | None = None,
        costs: Costs | None = None,
        look: AnyLook | None = None,
        chance: float = LOOK_CHANCE,
        planner: AnyPlanner = "expected-cost",
        task: Task = "single",
        budget: float | None = None,
        speed: float | None = None,
    ) -> str | None:
        """Return the room to look into next, to find one or several things at the least cost.

        The cost is that of going and of looking. The robot's own room is a room like others, with a
        way of 0; a second look there finds less, because it overlooks what the first one did
        (`bsg_models.search.looks`). A thing of which one was seen and is not in doubt is looked for
        where it was seen. Of several things, those are found; the others are searched for first.

        Args:
            things: any word, or several.
            here: the robot's room; None for the likeliest room, wherever it is.
            costs: (room, room) → cost, replacing what the graph measures; ∞ closes a way.
            look: cost of a look, of every room or by room, in the unit of the ways; None for the
                usual cost, see `bsg_models.search.looks`.
            chance: P(a look finds a thing that is there).
            planner: a name of `PLANNERS`, a `Planner`, or a function of `Knowledge`.
            task: whether one of each is enough (`single`), or all must be found (`all`).
            budget: what the search may cost, in the unit of the ways, or in seconds with a `speed`:
                then the room is that of the plan which most likely finds it within the budget.
            speed: of the robot, metres a second; a look takes as long as the way that costs it.

        Returns:
            Its id; `explore` if rooms that are not found yet are worth more; None if no room is
            left to search, or none within the budget.
        """
        chosen, search = find_planner(planner), _Search(costs, look, chance, task, budget, speed)
        search.check()
        if here is not None and chosen == PLANNERS["expected-cost"]:
            return self._first(self._plan(things, [here], search)[0].places[0])
        if budget is not None:
            raise RecipeError(
                "budget: needs `here`, the robot's room, and the planner expected-cost",
                code="budget-impossible",
            )
        if here is None:
            if costs is not None or look is not None:
                self._cost(costs, look)  # what is said must be right, though it does not count
            node = self._weigh(things, [], None, search)[0].choose_likeliest()
        else:
            start, (ways, looks) = find_room(self.graph, here), self._cost(costs, look)
            decision, _ = self._weigh(things, [start], ways, search)
            node = decision.choose(ways.costs, looks, here=start, planner=chosen)
        return None if node is None else self._name(node)

    @alone
    def next_place(
        self,
        thing: str,
        *,
        here: str,
        at: str | None = None,
        costs: Costs | None = None,
        look: float | None = None,
        chance: float = LOOK_CHANCE,
    ) -> Destination | None:
        """Return the piece of furniture to look at next, to find a thing at the least cost.

        All pieces that were seen, in any room, and the rest of each room are weighed at once, by
        what going and looking cost. Report a look that missed by `looked(room, thing, at=piece)`.

        Args:
            thing: any word.
            here: the robot's room.
            at: id of the piece where the robot is; None for the middle of the room.
            costs: as for `next_room`.
            look: cost of a look at a piece, in the unit of the ways; None for 2.5 m.
            chance: P(a look finds a thing that is there).

        Returns:
            A room, and a piece there; without a piece, enter the room, or look about in it for more
            furniture. None if nothing is left to search.
        """
        start, sought = find_room(self.graph, here), self._now.seek(thing)
        search = _Search(costs, chance=chance)
        search.check()
        piece = None if at is None else self._find_piece(at, start).name
        ways, looks = self._cost(costs, None)
        look_at = LOOK_AT * ways.metre if look is None else read_number("look", look, most=_MOST)
        rooms, (belief,) = self._weigh(thing, [start], ways, search)
        spots, place = keep_likeliest(self._now.list_places(sought), belief, here=start, at=piece)
        each = [looks[spot.node] if spot.piece is None else look_at for spot in spots]
        between = measure_spots(spots, self.graph, ways, given=costs is not None)
        decision = weigh_spots(spots, belief, rooms, chance=chance)
        (order,) = decision.plan(between, np.array(each), here=[place]).places
        if not order:
            return None
        return Destination(self._name(spots[order[0]].node), spots[order[0]].name)

    @alone
    def next_rooms(
        self,
        robots: Mapping[str, str],
        things: str | Sequence[str],
        *,
        costs: Costs | None = None,
        look: AnyLook | None = None,
        chance: float = LOOK_CHANCE,
        task: Task = "single",
        budget: float | None = None,
        speed: float | None = None,
    ) -> dict[str, str | None]:
        """Return the room that each of several robots looks into next: see `next_room`.

        The time until they have found it is least, if all move at the same speed.

        Args:
            robots: name of each robot → its room.
            things: any word, or several.
            costs: as for `next_room`, and so below.
            look: cost of a look.
            chance: P(a look finds a thing that is there).
            task: `single` or `all`.
            budget: of each robot.
            speed: of each robot.

        Returns:
            Name → id of a room, `explore`, or None for a robot that is not needed, or can reach no
            room.
        """
        if not isinstance(robots, Mapping) or not robots:
            raise RecipeError(
                f"robots: expected name → room of one or more, found {show_value(robots)}",
                code="robots-none",
            )
        search = _Search(costs, look, chance, task, budget, speed)
        plan = self._plan(things, [*robots.values()], search)[0]
        return {robot: self._first(n) for robot, n in zip(robots, plan.places, strict=True)}

    @alone
    def explain(
        self,
        things: str | Sequence[str],
        *,
        here: str,
        costs: Costs | None = None,
        look: AnyLook | None = None,
        chance: float = LOOK_CHANCE,
        task: Task = "single",
        budget: float | None = None,
        speed: float | None = None,
    ) -> tuple[Step, ...]:
        """Return the looks in the order of the plan whose first room is `next_room`.

        Arguments are those of `next_room`. A room comes again where a second look is worth it.
        Several rooms in a row that are not found yet are one step.
        """
        search = _Search(costs, look, chance, task, budget, speed)
        plan, decision, beliefs, ways, looks = self._plan(things, [here], search)
        (nodes,) = plan.places
        found = plan.problem.found(plan.looks[0])
        sought = [beliefs[number].probability for number in decision.things]
        likely = 1 - np.prod([1 - probability for probability in sought], axis=0)
        steps: list[Step] = []
        spent, at = 0.0, find_room(self.graph, here)
        for number, node in enumerate(nodes):
            way = float(ways.costs[at, node])
            cost = 0.0 if decision.is_known else float(looks[node])
            spent, at = spent + way + cost, node
            step = Step(
                room=self._name(node),
                label=self._label(node),
                probability=float(likely[node]),
                way=way,
                look=cost,
                found=float(found[number].prod()),
                any_found=float(1 - (1 - found[number]).prod()),
                seconds=None if speed is None else spent / ways.metre / speed,
            )
            if steps and step.room == EXPLORE == steps[-1].room:
                step = _join(steps.pop(), step)
            steps.append(step)
        return tuple(steps)

    @alone
    def belief(self, *, mode: Mode = "complete", top: int = 3) -> BeliefGraph:
        """Return the belief graph, for files and pages: `write_belief(seen.belief(), path)`.

        Args:
            mode: which blind nodes: as many as are expected (`complete`), or those of the paper's
                Table II, one for each of the top unseen classes (`unseen`).
            top: number of unseen classes per room.
        """
        from bsg_models.belief.belief_graph import believe  # an answer needs no graph

        kinds = [self._now.kinds.said[number] for number in range(len(self.graph.rooms))]
        expectation = self._now.expectation()
        pieces = find_pieces_of(self.graph, expectation.presence, kinds)
        return believe(
            self.graph, expectation, mode=mode, top=top, model=self.model, piece_of=pieces
        )

    @alone
    def expectation(self) -> Expectation:
        """Return what is believed of the building and its rooms, `[1 + R, C]`.

        It says what a person would find, as all answers do: classes have the rate of homes from the
        table of everyday things, mixed in. What annotators would note, says `Predictor`. It
        includes what looks have missed, and in the building what rooms not found yet may hold.
        """
        return self._now.expectation()

    @alone
    def asked(self, thing: str) -> str:
        """Return the name of the model that answers for a word, or of the table of things."""
        return self._words.answerer(self._words.understand(thing))

    @alone
    def understand(self, thing: str) -> Meaning:
        """Return what a word is taken for, and why.

        The building's own model is preferred. If it has no class for the word, the table of
        everyday things answers. A word that neither has is judged by what it means (`NounTable`);
        but not for a model that everybody may use, because that is for research.
        """
        return self._words.understand(thing)

    @alone
    def ways(self, costs: Costs | None = None) -> Ways:
        """Return the costs of going from room to room, at most 2,000, or 1,400 in a dense graph."""
        return measure_ways(self.graph, costs)

    def _known_costs(self, here: str, costs: Costs | None) -> dict[int, float]:
        """Return the cost of the way from a room to each node, without ways that are guessed."""
        start, ways = find_room(self.graph, here), self.ways(costs)
        lost = set() if costs else list_lost(self.graph)
        if start in lost:
            return {start: 0.0}
        return {
            node: float(cost) for node, cost in enumerate(ways.costs[start]) if node not in lost
        }

    def _name(self, node: int) -> str:
        rooms = self.graph.rooms
        return rooms[node - 1].name if node <= len(rooms) else EXPLORE

    def _label(self, node: int) -> str | None:
        rooms = self.graph.rooms
        return rooms[node - 1].label if node <= len(rooms) else NOT_FOUND

    def _cost(self, costs: Costs | None, look: AnyLook | None) -> tuple[Ways, Floats]:
        """Return the ways and the costs of looks, with those of rooms that are not found yet."""
        ways = self.ways(costs)
        looks = cost_looks(self.graph, ways, look)
        more = self._now.nodes - 1 - len(self.graph.rooms)
        every = np.concatenate([looks[:-1], np.repeat(looks[-1], more)])
        return add_places(ways, more) if more else ways, every

    def _first(self, nodes: Sequence[int]) -> str | None:
        return self._name(nodes[0]) if nodes else None

    def _plan(
        self, things: str | Sequence[str], robots: Sequence[str], search: _Search
    ) -> tuple[Plan, Decision, list[ThingBelief], Ways, Floats]:
        """Return the plan of some robots, by their rooms, and what it was made of."""
        search.check()
        here = [find_room(self.graph, room) for room in robots]
        ways, looks = self._cost(search.costs, search.look)
        decision, beliefs = self._weigh(things, here, ways, search)
        plan = decision.plan(ways.costs, looks, here=here, budget=search.spend(ways))
        return plan, decision, beliefs, ways, looks

    def _weigh(
        self,
        things: str | Sequence[str],
        here: Sequence[int],
        ways: Ways | None,
        search: _Search,
    ) -> tuple[Decision, list[ThingBelief]]:
        """Return what a decision depends on, and what is believed of the things."""
        words = _list_words(things)
        # A thing that is asked for in two words is one thing.
        meanings = {_key_of(self._words.understand(word)): word for word in reversed(words)}
        sought = [self._now.seek(word) for word in words if word in meanings.values()]
        beliefs, looks = [thing.belief for thing in sought], [thing.looks for thing in sought]
        open_: Bools = np.ones(self._now.nodes, dtype=bool)  # from wherever the robot is
        if ways is not None:
            open_ = np.asarray(np.isfinite(ways.costs[list(here)]).any(axis=0))
        chance, task = search.chance, search.task
        found = weigh(beliefs, looks, here=here, open_=open_, chance=chance, task=task)
        return found, beliefs


def _list_words(things: str | Sequence[str]) -> list[str]:
    if not isinstance(things, str | Sequence) or not len(things):
        raise RecipeError(
            f"things: expected one word or several, found {show_value(things)}",
            code="things-none",
        )
    return [things] if isinstance(things, str) else [*things]


def _key_of(meaning: Meaning) -> tuple[object, ...]:
    """Return what two words have in common that mean the same thing."""
    noun = meaning.noun
    if meaning.thing is not None:
        return meaning.thing.name, meaning.told
    parts = None if noun is None else (*split_head(noun.name)[0], noun.head, looks_of(noun.name))
    return meaning.class_index, parts


def _join(step: Step, more: Step) -> Step:
    """Return two steps into rooms that are not found yet as one."""
    return replace(
        step,
        probability=1 - (1 - step.probability) * (1 - more.probability),
        way=step.way + more.way,
        look=step.look + more.look,
        found=more.found,
        any_found=more.any_found,
        seconds=more.seconds,
    )
