"""Keep where things were seen before, and when everything was.

Every report has a time, if the graph has a clock. What is seen again within the hour, at the same
place, is one sighting; each thing keeps its last ones.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import replace

from bsg_data.errors import RecipeError
from bsg_models.belief.clock import DAY, HOUR, is_dated, read_time, show_time
from bsg_models.belief.partial_graph import PartialGraph, Remembered, SeenObject, Sighting

MOST_SIGHTINGS = 60  # of each thing: with two tours a day, of a month
MOST_IN_ALL = 50_000  # about 5 MB of JSON
LONGEST_STEP = 366 * DAY  # seconds by which a report may move the clock
MOST_THINGS = 10_000


def tell_time(graph: PartialGraph, time: float) -> PartialGraph:
    """Return the graph at a time, if it is later than its clock.

    Raises:
        RecipeError: for a time that is a year later: a clock that is wrong would make all old.
    """
    last = graph.now
    if last is not None and is_dated(last) and time > last + LONGEST_STEP:
        raise RecipeError(
            f"{graph.scene_id}: time: {show_time(time)} is more than a year after the last report, "
            f"of {show_time(graph.now)}; if the robot's clock is right, say `passes` first",
            code="time-far",
            where=graph.scene_id,
        )
    graph = _set_clock(graph, time)
    return replace(graph, now=time if graph.now is None else max(time, graph.now))


def _set_clock(graph: PartialGraph, time: float) -> PartialGraph:
    """Return a graph whose clock has dates, if a time is one; all of one without was seen then."""
    if graph.now is None:
        return _date(graph, time, lambda _: time)
    if is_dated(graph.now) or not is_dated(time):
        return graph
    by = time - graph.now
    memory = (
        replace(
            thing, sightings=tuple(s._replace(time=read_time(s.time + by)) for s in thing.sightings)
        )
        for thing in graph.memory
    )
    dated = _date(graph, time, lambda seen: None if seen is None else read_time(seen + by))
    return replace(dated, memory=tuple(memory))


def pass_until(graph: PartialGraph, now: float) -> PartialGraph:
    """Return the graph at a later time; all that a graph without a clock holds was seen then.

    Raises:
        RecipeError: for a time before the last report.
    """
    graph = _set_clock(graph, now)
    if graph.now is not None and now < graph.now:
        raise RecipeError(
            f"{graph.scene_id}: now: expected a time after {show_time(graph.now)}, that of the "
            f"last report, found {show_time(now)}",
            code="time-back",
            where=graph.scene_id,
        )
    return replace(graph, now=now)


def _find_latest(graph: PartialGraph) -> float | None:
    """Return the time of the last report; None if no report has one."""
    times = [seen.time for thing in graph.memory for seen in thing.sightings]
    for parts in (graph.objects, graph.rooms, graph.looks):
        times += [part.time for part in parts if part.time is not None]
    return max(times, default=None)


def say_time(
    where: str, time: float | None, *, age: float | None, now: float | None
) -> float | None:
    """Return the time of a sighting: as it is said, or so many hours before now.

    Without a clock, an age counts from 0.

    Raises:
        RecipeError: if both are given.
    """
    if age is None:
        return time
    if time is not None:
        raise RecipeError(f"{where}: give time or age, not both", code="time-twice", where=where)
    return read_time((now or 0.0) - age * HOUR)


def start_clock(graph: PartialGraph, now: float | None) -> PartialGraph:
    """Return a graph at the time that it says, and not before its last report.

    One that does not say the time, and has times, is at its last report.

    Raises:
        RecipeError: for reports of a day after now, or later.
    """
    latest = _find_latest(graph)
    if latest is None:
        return replace(graph, now=now)
    if now is not None and latest > now + DAY:
        raise RecipeError(
            f"now: {show_time(now)} is before the last report, of {show_time(latest)}; expected "
            "the same clock for all times",
            code="time-after-now",
            where=graph.scene_id,
        )
    return replace(graph, now=max(latest, 0.0 if now is None else now))


def _date(
    graph: PartialGraph, now: float, date: Callable[[float | None], float | None]
) -> PartialGraph:
    """Return a graph at a time, with other times of what was seen."""
    return replace(
        graph,
        now=now,
        objects=tuple(replace(obj, time=date(obj.time)) for obj in graph.objects),
        rooms=tuple(replace(r, time=date(r.time) if r.visited else None) for r in graph.rooms),
        looks=tuple(replace(look, time=date(look.time)) for look in graph.looks),
    )


def remember(
    memory: tuple[Remembered, ...], objects: Collection[SeenObject]
) -> tuple[Remembered, ...]:
    """Return the memory with where objects were, which are elsewhere now."""
    things = {thing.name: thing for thing in memory}
    for obj in objects:
        if obj.time is None:
            continue
        before = things.get(obj.name, Remembered(obj.name, obj.raw_category, (), 0.0))
        sightings = _add(before.sightings, Sighting(obj.time, obj.room_index, obj.on))
        is_sure = before.score is None or obj.score is None
        score = None if is_sure else max(before.score or 0.0, obj.score or 0.0)
        things[obj.name] = Remembered(obj.name, obj.raw_category, sightings, score)
    return _bound(things)


def _add(sightings: tuple[Sighting, ...], seen: Sighting) -> tuple[Sighting, ...]:
    """Return sightings with one more, by time; of those within the hour, the first."""
    if any(old[1:] == seen[1:] and abs(old.time - seen.time) < HOUR for old in sightings):
        return sightings
    return tuple(sorted((*sightings, seen), key=lambda old: old.time)[-MOST_SIGHTINGS:])


def _bound(memory: Mapping[str, Remembered]) -> tuple[Remembered, ...]:
    """Return what is remembered; of too much, each thing keeps its latest sightings.

    Of too many things, those that were seen last stay.
    """
    latest, things = MOST_SIGHTINGS, [*memory.values()]
    if len(things) > MOST_THINGS:
        things = sorted(things, key=lambda thing: thing.sightings[-1].time)[-MOST_THINGS:]
    while latest > 1 and sum(min(latest, len(t.sightings)) for t in things) > MOST_IN_ALL:
        latest //= 2
    return tuple(
        thing
        if len(thing.sightings) <= latest
        else replace(thing, sightings=thing.sightings[-latest:])
        for thing in things
    )
