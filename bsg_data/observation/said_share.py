"""What a robot's file may say of a room's hidden share: the share, or how it looked at the room."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, StrictBool

from bsg_data.errors import RecipeError
from bsg_data.observation.hidden_share import ShareBelief, estimate_hidden_share
from bsg_data.recipes import Record

Share = Annotated[float, Field(ge=0, le=1, strict=True)]
Seconds = Annotated[float, Field(ge=0, le=1e9, strict=True)]


class SaidShare(Record):
    """What a robot may say of the share of a room's objects that it has not seen.

    Attributes:
        visited: whether it was inside.
        hidden_share: the share, or its mean; None where it is estimated.
        hidden_share_sd: standard deviation of it.
        seconds_inside: how long it looked about there; with the next two and `visited`, this is
            what `estimate_hidden_share` reads.
        floor_in_view: share of the floor that its camera had in view.
        walls_in_view: share of the walls, likewise.
    """

    visited: StrictBool = True
    hidden_share: Share | None = None
    hidden_share_sd: Share = 0.0
    seconds_inside: Seconds | None = None
    floor_in_view: Share | None = None
    walls_in_view: Share | None = None

    def believe(self, *, floor_area: float | None = None) -> ShareBelief:
        """Return what the robot believes of the share.

        Args:
            floor_area: of the room, square metres; None where unknown.

        Raises:
            RecipeError: if it cannot be, or is said and left to be estimated, too.
        """
        if self.hidden_share is None:
            if self.hidden_share_sd:
                raise RecipeError("says hidden_share_sd without hidden_share; say both, or neither")
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
                    f"says hidden_share and {name}, from which it would be estimated; leave out "
                    "one of them"
                )
        return ShareBelief(self.hidden_share, self.hidden_share_sd)
