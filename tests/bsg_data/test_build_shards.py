"""A source that fails, goes away or changes while it is read: no scene is skipped for that."""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from conftest import BEDROOM, annotation_text

from bsg_data.build import build_dataset
from bsg_data.errors import SourceChangedError, SourceError, find_io_error
from bsg_data.sources.hm3d import HM3DFolder
from bsg_data.sources.table import ObjectTable


def all_bytes(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def change(path: Path) -> None:
    path.write_text(annotation_text({0: BEDROOM}))


def grow(path: Path) -> None:
    os.truncate(path, 10 * 2**30)  # sparse: it takes no disk


@pytest.mark.parametrize("harm", [Path.unlink, change, grow])
def test_a_scene_that_is_not_what_was_listed_stops_the_build(
    hm3d_folder: Path, tmp_path: Path, harm: Callable[[Path], None]
) -> None:
    source, out = HM3DFolder(hm3d_folder), tmp_path / "out"
    build_dataset(source, tmp_path / "whole", scenes_per_shard=2)
    (victim,) = hm3d_folder.rglob("*07.semantic.txt")
    kept = shutil.copy2(victim, tmp_path / "kept")

    def strike(done: int, total: int) -> None:
        if done == 1:
            harm(victim)

    with pytest.raises(SourceChangedError, match=r"abcdefghi07.*no scene was skipped"):
        build_dataset(source, out, scenes_per_shard=2, progress=strike)
    assert not out.exists()
    shutil.copy2(kept, victim)
    build_dataset(source, out, scenes_per_shard=2)
    assert all_bytes(out) == all_bytes(tmp_path / "whole")


@pytest.mark.parametrize("number", [errno.EIO, errno.ESTALE])
@pytest.mark.parametrize("fails_at", [5, 16])  # the listing reads twelve
def test_an_error_of_the_disk_stops_the_build_which_goes_on_later(
    hm3d_folder: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    number: int,
    fails_at: int,
) -> None:
    source, out, reads = HM3DFolder(hm3d_folder), tmp_path / "out", [0]
    opened = Path.open

    def fail(path: Path, *mode: Any, **options: Any) -> Any:
        if path.name.endswith(".semantic.txt"):
            reads[0] += 1
            if reads[0] == fails_at + 1:
                raise OSError(number, os.strerror(number))
        return opened(path, *mode, **options)

    monkeypatch.setattr(Path, "open", fail)
    with pytest.raises(SourceChangedError, match=os.strerror(number)):
        build_dataset(source, out, scenes_per_shard=2)
    assert not out.exists()
    monkeypatch.undo()
    build_dataset(source, out, scenes_per_shard=2)
    build_dataset(source, tmp_path / "whole", scenes_per_shard=2)
    assert all_bytes(out) == all_bytes(tmp_path / "whole")


def test_a_file_that_may_not_be_read_is_skipped_and_named(
    hm3d_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is so the next time, too: a build that waits for a permission would never end."""
    opened = Path.open

    def fail(path: Path, *mode: Any, **options: Any) -> Any:
        if path.name.endswith("07.semantic.txt"):
            raise PermissionError(errno.EACCES, "Permission denied")
        return opened(path, *mode, **options)

    monkeypatch.setattr(Path, "open", fail)
    manifest = build_dataset(HM3DFolder(hm3d_folder), tmp_path / "out")
    (skip,) = manifest.skipped
    assert (manifest.totals.scenes, skip.scene_id[-2:]) == (11, "07")
    assert skip.reason == "cannot be read (Permission denied)"


def test_a_table_that_is_written_anew_stops_the_build(tmp_path: Path) -> None:
    table = tmp_path / "objects.csv"
    rows = [f"scene-{k},room,chair\n" for k in range(4)]
    for then in ("".join(["scene,room,category\n", *rows[:2]]), "scene,room\n", "no table"):
        table.write_text("".join(["scene,room,category\n", *rows]))

        def strike(done: int, total: int, then: str = then) -> None:
            table.write_text(then)

        with pytest.raises(SourceChangedError, match="no scene was skipped"):
            build_dataset(ObjectTable(table), tmp_path / "out", scenes_per_shard=1, progress=strike)


def test_what_the_system_said_is_found_among_the_causes() -> None:
    def chain(cause: Exception) -> Exception:
        error = SourceError("a scene")
        error.__cause__ = SourceError("a file")
        error.__cause__.__cause__ = cause
        return error

    assert find_io_error(chain(OSError(errno.EIO, "Input/output error"))) is not None
    assert find_io_error(chain(PermissionError(errno.EACCES, "Permission denied"))) is None
    assert find_io_error(chain(OSError("broken image"))) is None  # a library's word for bytes
    assert find_io_error(chain(ValueError())) is None
