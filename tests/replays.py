"""A replay worked by hand: two robots look for a sink in a house of four rooms, three in a row."""

from __future__ import annotations

from bsg_models.evaluation.bootstrap import Estimate
from bsg_models.rendering.plan import KnownOutline, draw_plan
from bsg_models.rendering.replay import Replay, Visit, Walk

NAN = float("nan")


def make_replay(*, name: str = "kitchen", artifact: str = "sink") -> Replay:
    """Return a search in which one robot enters two rooms and the other one three."""
    squares = [((x, 0.0), (x + 3.0, 0.0), (x + 3.0, 3.0), (x, 3.0)) for x in (0.0, 3.0, 6.0)]
    rooms = [
        KnownOutline(1, "hall", squares[1], 0),
        KnownOutline(2, name, squares[2], 0),
        KnownOutline(3, "bedroom", squares[0], 0),
        KnownOutline(4, "bedroom", squares[0], 1),
    ]
    lamps, sink, found = (("lamp", 2),), ((artifact, 1), ("stove", 1)), (artifact,)
    ours = (
        Visit(1, (), 0.0, lamps, (), (0, 0.6, 0.2, 0.004), 3, 3.0),
        Visit(3, (3,), 3.0, (), (), (0, 0.9, 0, 0.1), 2, 6.0),
        Visit(2, (1, 2), 9.0, sink, found, (0, 0, 0, 0.1), None, None),
    )
    base = (
        Visit(1, (), 0.0, lamps, (), None, 3, 3.0),
        Visit(3, (3,), 3.0, (), (), None, 4, 3.5),
        Visit(4, (4,), 6.5, (("bed", 1),), (), None, 2, 9.5),
        Visit(2, (3, 1, 2), 16.0, sink, found, None, None, None),
    )
    return Replay(
        scene_id="house",
        episode=3,
        artifacts=(artifact,),
        task="single",
        world="geometry",
        unit="m",
        plan=draw_plan(rooms),
        doors=((1, 2), (1, 3), (3, 4)),
        holds=(2,),
        left_out=1,
        walks=(
            Walk("expected-cost", "universal", ours, 10.0, 3.5, Estimate(0.4, 0.31, 0.52, 50)),
            Walk("nearest", None, base, 17.25, 5.25, Estimate(0.0, NAN, NAN, 50)),
        ),
        searches=1500,
        buildings=5,
        chosen="It was drawn by hand.",
    )
