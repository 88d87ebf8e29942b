"""The fields of a robot's file about a room's hidden share."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, StrictBool

from bsg_data.errors import RecipeError
from bsg_data.observation.hidden_share import ShareBelief, estimate_hidden_share
from bsg_data.recipes import Record

Share = Annotated[float, Field(ge=0, le=1, strict=True)]
Seconds = Annotated[float, Field(ge=0, le=1e9, strict=True)]


class SaidShare(Record):
    """What a robot may report about the hidden share of a room.

    It reports the share itself, or how it looked at the room (see `estimate_hidden_share`).

    Attributes:
        visited: whether the robot was inside.
        hidden_share: the share, or its mean; None: estimate it from the fields below.
        hidden_share_sd: standard deviation of the share.
        seconds_inside: time that the robot spent in the room.
        floor_in_view: share of the floor that the camera had in view.
        walls_in_view: share of the walls that the camera had in view.
    """

    visited: StrictBool = True
    hidden_share: Share | None = None
    hidden_share_sd: Share = 0.0
    seconds_inside: Seconds | None = None
    floor_in_view: Share | None = None
    walls_in_view: Share | None = None

    def believe(self, *, floor_area: float | None = None) -> ShareBelief:
        """Return the belief about the hidden share.

        Args:
            floor_area: floor area of the room, square metres; None if unknown.

        Raises:
            RecipeError: if a value is impossible, or both the share and evidence are given.
        """
        if self.hidden_share is None:
            if self.hidden_share_sd:
                raise RecipeError("has hidden_share_sd without hidden_share; give both or neither")
            return estimate_hidden_share(
                visited=self.visited,
                seconds_inside=self.seconds_inside,
                floor_area=floor_area,
                floor_in_view=self.floor_in_view,
                walls_in_view=self.walls_in_view,
            )
        for name in ("seconds_inside", "floor_in_view", "walls_in_view"):
            if getattr(self, name) is not None:
                raise RecipeError(
                    f"has hidden_share and {name}, which serves to estimate it; leave out one of "
                    "them"
                )
        return ShareBelief(self.hidden_share, self.hidden_share_sd)
