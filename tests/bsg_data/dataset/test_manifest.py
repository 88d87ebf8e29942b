from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from pydantic import ValidationError

from bsg_data.build import build_dataset
from bsg_data.checks.dataset import check_dataset
from bsg_data.dataset.manifest import KEPT, ClassMapEntry, read_manifest
from bsg_data.dataset.splits import split_dataset
from bsg_data.errors import ClassMapError
from bsg_data.merge import merge_datasets
from bsg_data.recipes import SplitRecipe
from bsg_data.scene.class_map import OwnMap, load_class_map, parse_own_map
from bsg_data.sources.hm3d import HM3DFolder
from bsg_data.synthetic.buildings import write_synthetic

SPELLINGS = b"raw_category,category,class\nbed,bed,rest\nstove,stove,\nwall,wall,\n"
CLASSES = b"index,class,definition\n0,rest,To lie on.\n"


def write_map(folder: Path, *, spellings: bytes = SPELLINGS) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "mine.csv").write_bytes(spellings)
    (folder / "mine.classes.csv").write_bytes(CLASSES)
    (folder / "mine.structure.csv").write_bytes(b"category\nwall\n")
    return folder / "mine.csv"


@pytest.fixture
def own(hm3d_folder: Path, tmp_path: Path) -> Path:
    """A dataset of a class map of one's own, which is gone since."""
    path = write_map(tmp_path / "maps")
    build_dataset(HM3DFolder(hm3d_folder), tmp_path / "own", class_map=str(path))
    shutil.rmtree(tmp_path / "maps")
    return tmp_path / "own"


def kept_map(dataset: Path) -> Path:
    (path,) = dataset.joinpath(KEPT).glob("*/mine.csv")
    return path


def read_maps(dataset: Path) -> list[str | OwnMap]:
    return [entry.read(dataset) for entry in read_manifest(dataset).class_maps]


def test_a_dataset_keeps_a_map_of_ones_own_as_it_was(own: Path) -> None:
    (own_map,) = read_maps(own)
    assert isinstance(own_map, OwnMap)
    assert (own_map.name, own_map.spellings, own_map.classes) == ("mine", SPELLINGS, CLASSES)
    assert own_map.structure == b"category\nwall\n"
    assert load_class_map(str(kept_map(own))) == parse_own_map(own_map)  # a user can name it, too
    assert check_dataset(own) == ()


def test_what_is_kept_stays_until_it_is_replaced_and_a_change_is_a_fault(
    own: Path, hm3d_folder: Path
) -> None:
    path = kept_map(own)
    split_dataset(own, SplitRecipe())
    path.write_bytes(SPELLINGS + b"lamp,lamp,rest\n")
    with pytest.raises(ClassMapError, match=r"mine\.csv: differs from the class map .* built with"):
        read_maps(own)
    assert "differs from the class map" in str(check_dataset(own)[0])
    again = write_map(own.parent / "again", spellings=SPELLINGS + b"lamp,lamp,\n")
    build_dataset(HM3DFolder(hm3d_folder), own, class_map=again, force=True)
    assert not path.exists()
    assert check_dataset(own) == ()


def test_a_merged_dataset_keeps_the_maps_of_its_parts(own: Path, tmp_path: Path) -> None:
    list(write_synthetic(tmp_path / "made", scenes=3, seed=3))
    other = write_map(tmp_path / "other", spellings=SPELLINGS + b"sofa,sofa,rest\n")  # one name
    build_dataset(HM3DFolder(tmp_path / "made"), tmp_path / "synthetic", class_map=str(other))
    merge_datasets([own, tmp_path / "synthetic"], tmp_path / "merged")
    maps = read_maps(tmp_path / "merged")
    assert {own_map.spellings for own_map in maps if isinstance(own_map, OwnMap)} == {
        SPELLINGS,
        SPELLINGS + b"sofa,sofa,rest\n",
    }
    assert check_dataset(tmp_path / "merged") == ()


@pytest.mark.parametrize(
    "entry",
    [
        *(
            {"version": name, "sha256": "a" * 64}
            for name in ("../mine", "a/b", "a\\b", "nul\0", "")
        ),
        {"version": "mine", "sha256": "../../.." + "a" * 56},
    ],
)
def test_no_class_map_of_a_manifest_becomes_a_path_elsewhere(entry: dict[str, str]) -> None:
    with pytest.raises(ValidationError, match="pattern"):
        ClassMapEntry.model_validate(entry)
    ClassMapEntry(version="..", sha256="a" * 64)  # `...csv` is a file as any other
