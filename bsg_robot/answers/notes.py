"""What a person should know about how a robot's graph is read, a sentence each."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence

from bsg_data.scene.class_map import ClassMap, load_class_map
from bsg_data.scene.surroundings import KNOWN_SOURCES
from bsg_data.words.shown import SHOWN
from bsg_models.belief.hidden_share import VAGUE
from bsg_models.belief.partial_graph import PartialGraph
from bsg_models.runs.predictor import Predictor
from bsg_robot.answers.kinds import SURE, RoomKinds
from bsg_robot.answers.ways import list_lost
from bsg_robot.answers.words import find_everyday, find_kind
from bsg_robot.graph.robot_json import list_unmapped
from bsg_robot.graph.room_kinds import note_room_types
from bsg_robot.things.things import classify_seen

_MOST_NAMES = 5  # in a note
_WHOLE = 3  # a building has at least so many rooms, but for odd ones


def note_graph(graph: PartialGraph, predictor: Predictor, kinds: RoomKinds) -> Iterator[str]:
    """Yield the notes on a graph in the class space of a model.

    `kinds` has those of its rooms, and of rooms that are not found yet.
    """
    yield from _note_names(graph, predictor.class_map)
    yield from note_room_types(graph)
    yield from _note_kinds(graph, kinds)
    if graph.source is not None and graph.source not in KNOWN_SOURCES:
        known = ", ".join(KNOWN_SOURCES)
        yield f"source {graph.source!r} is read as unknown; models know {known}"
    yield from _note_classless(graph, predictor)
    if predictor.untaught:
        yield f"never taught, so the model expects none: {_list(predictor.untaught)}"
    if not predictor.reads_labels and any(room.room_type for room in graph.rooms):
        yield f"room types: {predictor.name} does not read them"
    rooms = [room.label or room.name for room in graph.rooms]
    if lost := [rooms[node - 1] for node in sorted(list_lost(graph))]:
        yield f"{_list(lost)}: neither position nor connection; the planner guesses the way"
    more = len(kinds.rooms) - len(graph.rooms)
    if not graph.rooms and not graph.objects and not more:
        yield "no rooms yet, so nothing is expected"
    if more and graph.more_rooms is None:
        yield (
            f"{more:,} more rooms are expected, not found yet: a home has a kitchen, a bathroom "
            "and a bedroom; say `more_rooms: 0` if the map is whole, or the `building_kind`"
        )
    elif 0 < len(graph.rooms) < _WHOLE and graph.more_rooms is None:
        yield (
            f"{_list(rooms)}: taken as the whole building; `more_rooms` says that there are rooms "
            "that are not found yet"
        )
    unsaid = [room.label or room.name for room in graph.rooms if room.share == VAGUE]
    if unsaid:
        yield (
            f"{_list(unsaid)}: nothing says how much was seen; assumed {VAGUE} hidden (say "
            "floor_in_view or hidden_share)"
        )


def note_words(unheard: Mapping[str, Iterable[str]]) -> Iterator[str]:
    """Yield what happens to words that say nothing."""
    for fate, words in unheard.items():
        if shown := [repr(word[:SHOWN]) for word in dict.fromkeys(words)]:
            yield f"{fate}: {_list(shown)}"


def _note_kinds(graph: PartialGraph, kinds: RoomKinds) -> Iterator[str]:
    """Yield which kinds of rooms were inferred, and which labels their things contradict."""
    read = []
    for number, room in enumerate(graph.rooms):
        first, *_ = kinds.said[number]
        if kinds.by_things[number] and kinds.known[number] and first[1] > SURE:
            read.append(f"{room.label or room.name} as {first[0]}")
    if read:
        yield f"{_list(read)}: read by what was seen; say `room_type` if that is wrong"
    building = int(kinds.building.argmax())
    if building and graph.building_kind is None and kinds.building[building] > SURE:
        yield (
            f"taken for a building of the kind {kinds.table.buildings[building]}, by its rooms; "
            "say `building_kind` if that is wrong"
        )
    for number, (label, kind) in kinds.doubted.items():
        room, (taken, _) = graph.rooms[number], kinds.said[number][0]
        yield (
            f"{room.label or room.name}: called {label}, but its things are those of: {kind}; "
            f"taken for: {taken}"
        )


def _note_names(graph: PartialGraph, class_map: ClassMap) -> Iterator[str]:
    """Yield which names are not in the class map, and which were read by a rule."""
    unmapped, things, kinds = list[str](), list[str](), list[str]()
    for name, times in Counter(dict(sorted(list_unmapped(graph).items()))).most_common():
        if class_map.classify(name).category is not None:
            continue
        shown = f"{name[:SHOWN]!r}"
        if thing := find_everyday(name):
            things.append(shown if name == thing.name else f"{shown} ({thing.name})")
        elif kind := find_kind(name):
            kinds.append(f"{shown} ({kind})")
        else:
            nearest = class_map.nearest(name) if len(unmapped) < _MOST_NAMES else ()
            near = f"; nearest: {', '.join(nearest)})" if nearest else ")"
            unmapped.append(f"{shown} ({times:,}×{near}")
    if unmapped:
        yield f"not in the class map, ignored: {_list(unmapped)}"
    if things:
        yield f"everyday things without a class, found by these words alone: {_list(things)}"
    if kinds:
        yield f"words that name no thing, ignored: {_list(kinds)}"
    seen = Counter(obj.raw_category for obj in graph.objects)
    often = sorted(seen, key=lambda name: (-seen[name], name))
    read = {name: classify_seen(name, class_map) for name in often}
    made = [f"{n!r} is {r.category!r} ({r.rule})" for n, r in read.items() if r.rule and r.category]
    if made:
        yield f"read by a rule: {_list(made)}"
    spoken = (word for word, _ in graph.detector or ())
    words = [word for word in spoken if classify_seen(word, class_map).category is None]
    if words:
        yield f"words of the detector that are not in the class map: {_list(words)}"


def _note_classless(graph: PartialGraph, predictor: Predictor) -> Iterator[str]:
    """Yield which seen objects have a known name and no class, by what the model does with them.

    Parts of the building are left out, because models count objects.
    """
    structure = load_class_map().structure
    names: dict[bool, Counter[str]] = {True: Counter(), False: Counter()}
    for obj in graph.objects:
        if obj.class_index is None and obj.category and obj.category not in structure:
            names[obj.category in predictor.vocabulary][obj.raw_category] += 1
    for is_read, counted in names.items():
        if counted:
            fate = "read as evidence, not counted" if is_read else "the model does not read them"
            shown = _list([name[:SHOWN] for name, _ in counted.most_common()])
            yield f"{shown}: not among the {len(predictor.classes)} classes; {fate}"


def _list(names: Sequence[str]) -> str:
    """Return the first names, and how many more there are."""
    more = f", and {len(names) - _MOST_NAMES:,} more" if len(names) > _MOST_NAMES else ""
    return ", ".join(name or "(no name)" for name in names[:_MOST_NAMES]) + more
