"""The terms of a source: licence and citation of all that is derived from it."""

from __future__ import annotations

import re
from dataclasses import dataclass, fields

from bsg_data.errors import SourceError

LICENCE_REF = "LicenseRef-"  # SPDX's prefix for a licence that is not on its list
_ADDRESS = r"https?://[^\s<>()\[\]|\"]+"


@dataclass(frozen=True, slots=True)
class Terms:
    """Licence and citation of data derived from a source, for the cards of datasets."""

    # its SPDX identifier, e.g. `Apache-2.0`; `LicenseRef-NAME` for one that SPDX does not list
    licence: str
    licence_url: str  # address of the text of the licence
    homepage: str  # address of the source
    citation: str  # how to cite the source, on one line
    sentence: str  # what a user must know about the terms, in one sentence

    def __post_init__(self) -> None:
        line = r".*\S.*", "one line"
        address = _ADDRESS, "an address"
        spdx = r"[A-Za-z0-9.+-]+", f"an SPDX identifier such as MIT, or {LICENCE_REF}NAME"
        rules = (spdx, address, address, line, line)
        for field, (pattern, expected) in zip(fields(self), rules, strict=True):
            value = getattr(self, field.name)
            if not re.fullmatch(pattern, value):
                message = f"{field.name}: expected {expected}, found {value!r}"
                raise SourceError(message, code="terms-malformed", where=field.name)


def is_address(text: str) -> bool:
    """Say whether a text is a web address without characters that could end a link."""
    return re.fullmatch(_ADDRESS, text) is not None
