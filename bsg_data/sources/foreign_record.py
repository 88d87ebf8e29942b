"""Records in the files of other programs: keys that we do not read are ignored."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

MAX_METRES = 10_000.0  # from the origin of a building
Metres = Annotated[float, Field(ge=-MAX_METRES, le=MAX_METRES)]


class ForeignRecord(BaseModel):
    """A frozen record that another program wrote, with keys of its own."""

    model_config = ConfigDict(extra="ignore", frozen=True)


class Position(ForeignRecord):
    """A point, in metres."""

    x: Metres
    y: Metres
    z: Metres
