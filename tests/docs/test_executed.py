"""The tutorials and the notebooks run as they stand, and show what they print."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import pytest
from conftest import REPOSITORY, list_unpinned, load_script

if sys.version_info < (3, 11):
    pytest.skip("`make docs` needs Python 3.11", allow_module_level=True)

EXECUTE = load_script("site/execute")
TUTORIALS = sorted((REPOSITORY / "docs" / "tutorials").glob("*.md"))
NUMERICS = ("numpy", "pandas", "scipy", "torch", "torch-geometric")
NOTEBOOKS = sorted((REPOSITORY / "docs" / "notebooks").glob("*.ipynb"))


def test_there_are_three_tutorials_and_two_notebooks() -> None:
    assert [path.stem for path in TUTORIALS] == ["data", "model", "robot"]
    assert [path.stem for path in NOTEBOOKS] == ["ask", "dataset"]


@pytest.mark.slow
@pytest.mark.parametrize("path", TUTORIALS, ids=lambda path: path.stem)
def test_a_tutorial_shows_what_it_prints(path: Path) -> None:
    text = path.read_text("utf-8")
    with EXECUTE.working_folder() as folder:
        compare(EXECUTE.execute_page(text, folder), text)


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_shows_what_it_prints(path: Path) -> None:
    """Pictures are there; their bytes depend on the fonts of the machine."""
    with EXECUTE.working_folder() as folder:
        now = json.loads(EXECUTE.execute_notebook(path, folder))
    kept = json.loads(path.read_text("utf-8"))
    compare(read_outputs(now), read_outputs(kept))


def compare(now: object, kept: object) -> None:
    """Training rounds otherwise with other versions; with these it is enough that all runs."""
    if now != kept and (others := list_unpinned(*NUMERICS)):
        pytest.skip(f"ran to its end; the figures shown are not of {others}")
    assert now == kept, "run `make docs`"


def read_outputs(notebook: dict[str, Any]) -> list[list[Any]]:
    """Return what each cell of code shows: text as it is, of a picture its kind."""
    shown = []
    for cell in (cell for cell in notebook["cells"] if cell["cell_type"] == "code"):
        outputs = []
        for output in cell["outputs"]:
            data = output.get("data", {})
            outputs.append(sorted(data) if "image/png" in data else output.get("text") or data)
        shown.append(outputs)
    return shown


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_every_picture_of_a_notebook_is_told_in_words(path: Path) -> None:
    """The site takes `alt` of a cell as the words of its picture."""
    cells = [
        cell
        for cell in json.loads(path.read_text("utf-8"))["cells"]
        if any("image/png" in output.get("data", {}) for output in cell.get("outputs", ()))
    ]
    assert cells
    for cell in cells:
        assert len(cell["outputs"]) == 1, "one picture a cell: the site counts them"
        assert len(cell["metadata"].get("alt", "").split()) >= 5, cell["source"]


def test_no_notebook_names_a_folder_of_a_machine() -> None:
    for path in NOTEBOOKS:
        text = path.read_text("utf-8")
        assert not any(part in text for part in ("site-packages", str(REPOSITORY), "/tmp/")), path


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
