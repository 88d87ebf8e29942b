from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from conftest import KITCHEN, annotation_text, write_scene

from bsg_data.build import Part, build_dataset, build_part, finalise_dataset
from bsg_data.checks.dataset import check_dataset
from bsg_data.errors import DatasetError, RecipeError
from bsg_data.sources.hm3d import HM3DFolder

SHARDS = 6  # of the twelve buildings, two in each


def all_bytes(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def build(folder: Path, out: Path, number: int, of: int, *, force: bool = False) -> tuple[int, ...]:
    part = Part(number, of)
    return build_part(HM3DFolder(folder), out, part, scenes_per_shard=2, force=force).missing


@pytest.fixture
def whole(hm3d_folder: Path, tmp_path: Path) -> dict[str, bytes]:
    """The bytes of the twelve buildings, built at once, with something left out."""
    write_scene(hm3d_folder, "00042-broken00000", b"not an annotation")
    write_scene(hm3d_folder, "00005-abcdefghi05", annotation_text({0: KITCHEN}), split="minival")
    build_dataset(HM3DFolder(hm3d_folder), tmp_path / "whole", scenes_per_shard=2)
    return all_bytes(tmp_path / "whole")


def test_parts_in_any_order_give_the_bytes_of_one_build(
    hm3d_folder: Path, tmp_path: Path, whole: dict[str, bytes]
) -> None:
    out = tmp_path / "out"
    missing = [build(hm3d_folder, out, number, 3) for number in (3, 1, 3, 2)]
    assert [len(left) for left in missing] == [5, 2, 2, 0]
    assert not out.exists()
    seen = []
    finalise_dataset(out, progress=lambda done, total: seen.append((done, total)))
    assert seen[-1] == (7, 7)
    assert all_bytes(out) == whole
    assert check_dataset(out) == ()
    assert not list(tmp_path.glob("*.partial"))


def test_parts_at_once_do_not_lock_each_other_out(
    hm3d_folder: Path, tmp_path: Path, whole: dict[str, bytes]
) -> None:
    """Seven parts begin at the same moment, and each of them twice."""
    out = tmp_path / "out"
    with ThreadPoolExecutor(14) as pool:
        futures = [pool.submit(build, hm3d_folder, out, n % 7 + 1, 7) for n in range(14)]
        assert () in [future.result() for future in futures]
    finalise_dataset(out)
    assert all_bytes(out) == whole


def test_what_is_missing_or_damaged_is_named_by_its_part(
    hm3d_folder: Path, tmp_path: Path, whole: dict[str, bytes]
) -> None:
    out, growing = tmp_path / "out", tmp_path / "out.partial"
    with pytest.raises(DatasetError, match=r"holds no part of a build; .*--parts I/N"):
        finalise_dataset(out)
    for number in (1, 2, 4):
        build(hm3d_folder, out, number, 4)
    (growing / "objects" / "part-00001.parquet").write_bytes(b"PAR1")
    with pytest.raises(DatasetError, match=r"3 of 7 shards missing.*--parts: 2/4, 3/4$"):
        finalise_dataset(out)
    assert not out.exists()
    for number in (2, 3):
        build(hm3d_folder, out, number, 4)
    finalise_dataset(out)
    assert all_bytes(out) == whole
    with pytest.raises(DatasetError, match="is a finished dataset; --force replaces it"):
        build(hm3d_folder, out, 1, 4)


def test_a_build_at_once_goes_on_from_parts(
    hm3d_folder: Path, tmp_path: Path, whole: dict[str, bytes]
) -> None:
    build(hm3d_folder, tmp_path / "out", 2, 3)
    build_dataset(HM3DFolder(hm3d_folder), tmp_path / "out", scenes_per_shard=2)
    assert all_bytes(tmp_path / "out") == whole


def test_parts_of_another_build_are_refused_and_kept(hm3d_folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    build(hm3d_folder, out, 1, 2)
    before = all_bytes(tmp_path / "out.partial")
    write_scene(hm3d_folder, "00000-abcdefghi00", annotation_text({0: [*KITCHEN, "bed"]}))
    with pytest.raises(DatasetError, match=r"or the source changed since\); remove it"):
        build(hm3d_folder, out, 2, 2)
    with pytest.raises(DatasetError, match="holds parts of another build"):
        build_dataset(HM3DFolder(hm3d_folder), out)
    assert all_bytes(tmp_path / "out.partial") == before


def test_force_replaces_a_dataset_when_the_parts_are_finished(
    hm3d_folder: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    build_dataset(HM3DFolder(hm3d_folder), out)
    build(hm3d_folder, out, 1, 1, force=True)
    with pytest.raises(DatasetError, match="--force replaces it"):
        finalise_dataset(out)
    assert finalise_dataset(out, force=True).scenes_per_shard == 2


def test_a_class_map_of_ones_own_is_found_without_its_file(
    hm3d_folder: Path, tmp_path: Path
) -> None:
    own = tmp_path / "own.csv"
    rows = "raw_category,category,class\nstove,stove,stove\nbed,bed,bed\n"
    own.write_text(rows, "utf-8")
    words = {"class_map": str(own), "scenes_per_shard": 2}
    build_dataset(HM3DFolder(hm3d_folder), tmp_path / "whole", **words)  # type: ignore[arg-type]
    build_part(HM3DFolder(hm3d_folder), tmp_path / "out", Part(1, 1), **words)  # type: ignore[arg-type]
    own.unlink()
    finalise_dataset(tmp_path / "out")
    assert all_bytes(tmp_path / "out") == all_bytes(tmp_path / "whole")


@pytest.mark.parametrize(("number", "of"), [(0, 3), (4, 3), (1, 0)])
def test_there_is_no_such_part(number: int, of: int) -> None:
    with pytest.raises(RecipeError, match="expected I/N with I from 1 to N"):
        Part(number, of)
