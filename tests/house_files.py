"""A `.house` file of Matterport3D, written by hand to the public description of the format."""

from __future__ import annotations

# Two rooms side by side with a door between them, and a mirrored one; written by hand to
# niessner/Matterport, data_organization.md. The L of room 0 is an L in its plan, too: 4 m by 4 m
# without a corner of 2 m by 2 m.
HOUSE = """\
ASCII 1.1
H  -  -  1 1 10 2 1 5 4 3 1 1  0 0 0 0 0  0 0 0  8 4 3  0 0 0 0 0
L  0  0  -  4 2 0  0 0 0  8 4 3  0 0 0 0 0
R  0 0  0 0  k  1 1 0  0 0 0  4 4 2.5  2.5  0 0 0 0
R  1 0  0 0  b  6 2 0  4.1 0 0.1  8 4 2.5  2.4  0 0 0 0
R  2 0  0 0  Z  9 2 0  9 0 0  10 1 1  1  0 0 0 0
P  0 0 1  D  4 1 0  4.1 2 2  0 0 0 0
S  0 0  0  F  1 1 0  0 0 1  0 0 0  4 4 0  0 0 0 0 0
S  1 1  0  F  6 2 0  0 0 1  4.1 0 0.1  8 4 0.1  0 0 0 0 0
V  0 0  F  0 0 0  0 0 1  0 0 0
V  1 0  F  4 0 0  0 0 1  0 0 0
V  2 0  F  4 2 0  0 0 1  0 0 0
V  3 0  F  2 2 0  0 0 1  0 0 0
V  4 0  F  2 4 0  0 0 1  0 0 0
V  5 0  F  0 4 0  0 0 1  0 0 0
V  6 1  F  4.1 0 0.1  0 0 1  0 0 0
V  7 1  F  8 0 0.1  0 0 1  0 0 0
V  8 1  F  8 4 0.1  0 0 1  0 0 0
V  9 1  F  4.1 4 0.1  0 0 1  0 0 0
P  00ebbf3782c64d74aaf7dd39cd561175  0 0  0  1 1 1.5  0 0 0 0 0
I  0 0   00ebbf3782c64d74aaf7dd39cd561175  0 0  0
C  0  1 wall  1 wall  0 0 0 0 0
C  1  2 coffee#table  5 table  0 0 0 0 0
C  2  3 bed  11 bed  0 0 0 0 0
C  3  4 wall#/otherroom  1 wall  0 0 0 0 0
O  0 0 1  1 1 0.25  1 0 0  0 1 0  0.5 0.25 0.25  0 0 0 0 0 0 0 0
O  1 1 2  6 2 0.5  0.70710678 0.70710678 0  -0.70710678 0.70710678 0  1 1 0.5  0 0 0 0 0 0 0 0
O  2 1 -1  6 2 1  0 0 0  0 0 0  -1 -1 -1  0 0 0 0 0 0 0 0
O  3 -1 0  4 2 1  1 0 0  0 1 0  4 0.1 1  0 0 0 0 0 0 0 0
O  4 2 3  9.5 0.5 0.5  1 0 0  0 1 0  0.1 0.1 0.1  0 0 0 0 0 0 0 0
E  0 0 1  0.5  1 1 0.5  0.5 0.75 0  1.5 1.25 0.5  0 0 0 0 0
"""


def change(line: str, other: str) -> str:
    """Return the house with a line that begins so replaced, or left out."""
    lines = [other if text.startswith(line) else text for text in HOUSE.split("\n")]
    return "\n".join(text for text in lines if text != "-")
