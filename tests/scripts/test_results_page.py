"""A page as Markdown, worked out by hand."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from results_page import (
    Provenance,
    ResultsPage,
    ResultsTable,
    format_command,
    format_estimate,
    format_page,
    is_told_apart,
    write_page,
)

from bsg_data.errors import DatasetError
from bsg_models.evaluation.bootstrap import Estimate

PAGE = ResultsPage(
    "Beds",
    ("`a` is best.",),
    (ResultsTable("How many", ("model", "beds"), (("`a`", "2"),), "More is better."),),
    Provenance("python x.py", "2026-01-02", (("numpy", "2.0"),), "hm3d45-v2", "ab" * 32, 145, 50),
)
TEXT = """\
# Beds

`a` is best.

## How many

More is better.

| model | beds |
|---|---|
| `a` | 2 |

## How it was made

```sh
python x.py
```

- Date: 2026-01-02
- Versions: numpy 2.0
- Dataset: 145 buildings (50 with geometry), class space hm3d45-v2, `abababababababab` \
(start of the sha256 of `dataset.json` before the split)
"""


def test_a_page_has_conclusions_tables_and_how_it_was_made(tmp_path: Path) -> None:
    assert format_page(PAGE) == TEXT
    evil = replace(PAGE, provenance=replace(PAGE.provenance, class_space="<b>|[x](y)"))
    assert r"class space &lt;b&gt;\|\[x\](y), `abab" in format_page(evil)
    write_page(PAGE, tmp_path / "results" / "beds.md")
    assert (tmp_path / "results" / "beds.md").read_text("utf-8") == TEXT


def test_a_page_that_cannot_be_written_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(DatasetError, match="cannot be written"):
        write_page(PAGE, tmp_path / "file" / "beds.md")


@pytest.mark.parametrize(
    ("argv", "command"),
    [
        (["scripts/measure/a.py"], "python scripts/measure/a.py"),
        (["/srv/x.py", "--out=/srv/b/c.md"], "python x.py --out=c.md"),
        (["a.py", "~/data", "../../up", "docs/a.md"], "python a.py data up docs/a.md"),
        (["a.py", "two words"], "python a.py 'two words'"),
    ],
)
def test_a_command_is_shown_without_the_folders_of_a_machine(argv: list[str], command: str) -> None:
    assert format_command(argv) == command


def test_an_estimate_without_value_or_interval_says_so() -> None:
    nan = float("nan")
    assert format_estimate(Estimate(nan, nan, nan, 0)) == "–"
    assert format_estimate(Estimate(0.5, nan, nan, 3), digits=2) == "0.50"


@pytest.mark.parametrize(
    ("low", "high", "apart"), [(0.1, 0.2, True), (-0.2, -0.1, True), (-0.1, 0.1, False)]
)
def test_an_interval_without_0_tells_apart(low: float, high: float, apart: bool) -> None:
    assert is_told_apart(Estimate((low + high) / 2, low, high, 1)) is apart
    assert not is_told_apart(Estimate(1.0, float("nan"), float("nan"), 1))
