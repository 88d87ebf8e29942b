"""Scene ids: five to seven digits of a number and the building's own hash, or the hash alone."""

from __future__ import annotations

import re

# Six and seven digits are of our own synthetic buildings, which have a hash as HM3D's have;
# 240101-office is a name.
_NUMBERED = re.compile(r"([0-9]{5}|[0-9]{6,7}(?=-[A-Za-z0-9]{11}$))-(.+)")


def split_scene_id(scene_id: str) -> tuple[int | None, str]:
    """Split a scene id into its number, None without one, and the building's own hash.

    >>> split_scene_id("00006-HkseAnWCgqk")
    (6, 'HkseAnWCgqk')
    >>> split_scene_id("HkseAnWCgqk")
    (None, 'HkseAnWCgqk')
    >>> split_scene_id("240101-office")
    (None, '240101-office')
    """
    match = _NUMBERED.fullmatch(scene_id)
    return (int(match[1]), match[2]) if match else (None, scene_id)


def building_hash(scene_id: str) -> str:
    """Return the building's own hash: the scene id without its number.

    >>> building_hash("00006-HkseAnWCgqk")
    'HkseAnWCgqk'
    """
    return split_scene_id(scene_id)[1]
