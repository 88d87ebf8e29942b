"""What a robot has seen and believes, as markers that RViz and Foxglove draw."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from geometry_msgs.msg import Point, Pose, Vector3
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from bsg_robot.answers.seen_building import SeenBuilding

_ROOM, _OBJECT, _WAY, _LETTER = 0.6, 0.15, 0.05, 0.3  # metres
_MOST_EXPECTED = 3  # classes in the name of a room
_GREY = ColorRGBA(r=0.6, g=0.6, b=0.6, a=0.8)
_WHITE = ColorRGBA(r=1.0, g=1.0, b=1.0, a=1.0)

XYZ = tuple[float, float, float]


def draw(seen: SeenBuilding, *, thing: str | None, frame: str) -> MarkerArray:
    """Return the markers of all rooms, ways and objects whose positions are known.

    Rooms show the probability of a thing, from blue to red; without one, what is likeliest there.
    """
    header, rooms = Header(frame_id=frame), seen.graph.rooms
    found = {} if thing is None else {p.room: p.probability for p in seen.where(thing)}
    markers = [Marker(header=header, action=Marker.DELETEALL)]
    for number, room in enumerate(rooms):
        if room.position is not None:
            name = room.label or room.name
            content = _say(seen, room.name, thing, found.get(room.name))
            color = _heat(found[room.name]) if room.name in found else _GREY
            ball = _mark("rooms", number, Marker.SPHERE, header, color, _ROOM)
            text = _mark("names", number, Marker.TEXT_VIEW_FACING, header, _WHITE, _LETTER)
            ball.pose = Pose(position=_point(room.position))
            text.pose = Pose(position=_point(room.position, up=_ROOM))
            text.text = f"{name}\n{content}"
            markers += [ball, text]
    ways = _mark("ways", 0, Marker.LINE_LIST, header, _GREY, _WAY)
    ways.points = list(
        _ends((rooms[a - 1].position, rooms[b - 1].position) for a, b in seen.graph.adjacency)
    )
    things = _mark("objects", 0, Marker.SPHERE_LIST, header, _WHITE, _OBJECT)
    things.points = [_point(obj.position) for obj in seen.graph.objects if obj.position is not None]
    return MarkerArray(markers=[*markers, *(mark for mark in (ways, things) if mark.points)])


def _say(seen: SeenBuilding, room: str, thing: str | None, found: float | None) -> str:
    if thing is not None and found is not None:
        return f"{thing} {found:.0%}"
    likeliest = seen.expected(room)[:_MOST_EXPECTED]
    return ", ".join(f"{kind.name} {kind.probability:.0%}" for kind in likeliest)


def _mark(
    space: str, number: int, kind: int, header: Header, color: ColorRGBA, size: float
) -> Marker:
    scale = Vector3(x=size, y=size, z=size)
    return Marker(header=header, ns=space, id=number, type=kind, color=color, scale=scale)


def _ends(pairs: Iterable[tuple[XYZ | None, XYZ | None]]) -> Iterator[Point]:
    for a, b in pairs:
        if a is not None and b is not None:
            yield from (_point(a), _point(b))


def _point(position: XYZ, *, up: float = 0.0) -> Point:
    x, y, z = map(float, position)
    return Point(x=x, y=y, z=z + up)


def _heat(share: float) -> ColorRGBA:
    return ColorRGBA(r=float(share), g=0.2, b=1.0 - float(share), a=0.9)
