"""What is ours is told by its name, and nothing else is removed."""

from __future__ import annotations

from pathlib import Path

import pytest

from bsg_data.dataset.own_files import is_own, list_foreign, remove_own
from bsg_data.dataset.publication import list_paths
from bsg_data.errors import DatasetError


@pytest.mark.parametrize(
    "path",
    [
        "dataset.json",
        "README.md",
        "splits.parquet",
        "scenes/part-00012.parquet",
        "pairs/fold-3-00001.parquet",
        ".reports/recipe.json",
        ".reports/part-00012.json",
        ".reports/parts-of-10",
        ".reports/.plan.json.partial",
        "rooms/.part-00000.parquet.partial",
        ".revision/new/pairs/.train-00000.parquet.partial",
        ".revision/old/dataset.json",
        "class_maps/0123456789ab/mine.structure.csv",
    ],
)
def test_names_that_commands_give(path: str) -> None:
    assert is_own(path)


@pytest.mark.parametrize(
    "path",
    [
        "thesis.tex",
        "pairs/notes.txt",
        "pairs/train-1.parquet",
        "pairs/train-00000.parquet.bak",
        "scenes/part-00012.parquet/thesis.tex",
        ".reports/notes.json",
        ".revision/thesis.tex",
        ".revision/mine/dataset.json",
        ".thesis.tex.partial",
        "class_maps/mine.csv",
    ],
)
def test_names_that_no_command_gives(path: str) -> None:
    assert not is_own(path)


def test_a_users_file_stops_the_removal_before_anything_goes(tmp_path: Path) -> None:
    for name in ("dataset.json", ".reports/recipe.json", "rooms/part-00000.parquet", "pairs/mine"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(name)
    before = list_paths(tmp_path)
    with pytest.raises(DatasetError, match=r"holds pairs/mine, which this program did not write"):
        remove_own(tmp_path)
    assert list_paths(tmp_path) == before
    assert list_foreign(tmp_path) == ["pairs/mine"]
    remove_own(tmp_path, below=".reports")
    assert list_paths(tmp_path) == [path for path in before if not path.startswith(".reports")]
    (tmp_path / "pairs" / "mine").unlink()
    remove_own(tmp_path)
    assert not tmp_path.exists()
    remove_own(tmp_path)  # what is not there is removed


def test_a_link_is_not_gone_through(tmp_path: Path) -> None:
    victim, folder = tmp_path / "victim", tmp_path / "folder"
    (victim / "rooms").mkdir(parents=True)
    (victim / "rooms" / "part-00000.parquet").write_text("mine")
    folder.mkdir()
    (folder / "rooms").symlink_to(victim / "rooms")
    with pytest.raises(DatasetError, match="holds rooms, which this program did not write"):
        remove_own(folder)
    (tmp_path / "link").symlink_to(victim)
    with pytest.raises(DatasetError, match="it is a link"):
        remove_own(tmp_path / "link")
    assert list_paths(victim) == ["rooms/part-00000.parquet"]


def test_what_says_what_a_folder_is_goes_last(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("dataset.json", "README.md", "splits.parquet"):
        (tmp_path / name).write_text(name)
    gone: list[str] = []
    monkeypatch.setattr(Path, "unlink", lambda path: gone.append(path.name))
    with pytest.raises(DatasetError, match="cannot be removed"):  # for its files are there
        remove_own(tmp_path, last=["dataset.json"])
    assert gone == ["README.md", "splits.parquet", "dataset.json"]
