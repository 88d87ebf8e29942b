"""The tutorials run as they stand, and show what they print."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from conftest import REPOSITORY, list_unpinned, load_script

if sys.version_info < (3, 11):
    pytest.skip("`make docs` needs Python 3.11", allow_module_level=True)

EXECUTE = load_script("site/execute")
TUTORIALS = sorted((REPOSITORY / "docs" / "tutorials").glob("*.md"))
NUMERICS = ("numpy", "pandas", "scipy", "torch", "torch-geometric")


@pytest.mark.heavy
@pytest.mark.parametrize("path", TUTORIALS, ids=lambda path: path.stem)
def test_a_tutorial_shows_what_it_prints(path: Path) -> None:
    text = path.read_text("utf-8")
    with EXECUTE.working_folder() as folder:
        compare(EXECUTE.execute_page(text, folder), text)


def compare(now: object, kept: object) -> None:
    """Training rounds otherwise with other versions; with these it is enough that all runs."""
    if now != kept and (others := list_unpinned(*NUMERICS)):
        pytest.skip(f"ran to its end; the figures shown are not of {others}")
    assert now == kept, "run `make docs`"


PAGE = """# Page

```csv title="a.csv"
scene,room,category
```

```python
from pathlib import Path

print(len(Path("a.csv").read_text()))
```

```text
what stood here before
```

```sh
pip install something
bsg-data map show "trash can"    # a comment
```

```text
```
"""


def test_a_page_by_hand(tmp_path: Path) -> None:
    text = EXECUTE.execute_page(PAGE, tmp_path)
    assert "```text\n20\n```" in text
    assert "what stood here before" not in text
    assert "class garbage bin\n```" in text
    assert EXECUTE.execute_page(text, tmp_path) == text


def test_what_prints_and_is_not_shown_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="prints what is not shown"):
        EXECUTE.execute_page("```python\nprint(1)\n```\n", tmp_path)


def test_a_command_that_fails_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="bsg-data info nowhere"):
        EXECUTE.execute_page("```sh\nbsg-data info nowhere\n```\n", tmp_path)
