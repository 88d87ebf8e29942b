from __future__ import annotations

import pytest
from refusals import refuses

from bsg_data.errors import SourceError
from bsg_data.sources.hm3d import HM3DFolder
from bsg_data.sources.source import SourceRow, Terms


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("licence", "CC BY 4.0"),
        ("licence", "MIT\nlicense_name: x"),
        ("licence_url", "creativecommons.org"),
        ("homepage", "javascript:alert(1)"),
        ("citation", ""),
        ("sentence", "One.\n---\nTwo."),
    ],
)
def test_terms_that_would_spoil_a_card_are_refused(field: str, value: str) -> None:
    terms = {
        "licence": "MIT",
        "licence_url": "https://opensource.org/license/mit",
        "homepage": "https://example.org",
        "citation": "A. Doll, 2020",
        "sentence": "The houses are under the MIT licence.",
    }
    row = SourceRow("houses", HM3DFolder, Terms(**terms))
    assert row.terms.licence == "MIT"
    with refuses(SourceError, "terms-malformed", field, golden=False):
        Terms(**{**terms, field: value})
