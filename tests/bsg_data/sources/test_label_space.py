"""Label spaces: the published ones, and files of one's own, sound and damaged."""

from __future__ import annotations

from pathlib import Path

import pytest
from refusals import refuses

from bsg_data.errors import SourceError
from bsg_data.sources.label_space import list_label_spaces, load_label_space


def test_published_spaces_translate_names() -> None:
    assert list_label_spaces() == ("ade20k", "mpcat40")
    space = load_label_space("mpcat40")
    assert (space.name, space.names, space.translate("tv_monitor")) == ("mpcat40", {}, "tv")
    assert space.translate("zzqx") == "zzqx"
    assert (space.usual[0], space.usual[22], space.usual[41]) == ("void", "tv_monitor", "unlabeled")
    assert (len(space.usual), len(space.categories)) == (42, 42)
    larger = load_label_space("ade20k").usual
    assert sorted(larger) == list(range(150)), "as Hydra and networks count them, wall first"
    assert (larger[0], larger[19], larger[124], larger[149]) == (
        "wall",
        "chair",
        "microwave",
        "flag",
    )
    assert space.sha256 != load_label_space("ade20k").sha256


def test_a_file_of_hydra_names_numbers(tmp_path: Path) -> None:
    path = tmp_path / "lab.yaml"
    path.write_text(
        "label_names:\n- {label: 3, name: chair, colour: red}\n- {name: bed, label: 0}\n"
    )
    space = load_label_space(str(path))
    assert (space.name, dict(space.names), dict(space.categories)) == (
        "lab",
        {3: "chair", 0: "bed"},
        {},
    )


@pytest.mark.parametrize(
    ("name", "text", "code"),
    [
        ("a.yaml", b"names: []", "label-space-malformed"),
        ("a.yaml", b"label_names: [{label: x, name: bed}]", "label-space-malformed"),
        ("a.yaml", b"label_names: [&a {label: 1, name: bed}, *a]", "label-space-malformed"),
        ("a.csv", b"number,name\n1,bed\n", "label-space-malformed"),
        ("a.csv", b"label,name\n1,bed\n-1,chair\n", "label-space-malformed"),
        ("a.csv", b"label,name\n1,bed\n1,chair\n", "label-twice"),
        ("a.csv", b"label,name\n1,b\xe9d\n", "label-space-malformed"),
    ],
)
def test_a_damaged_file_is_named(tmp_path: Path, name: str, text: bytes, code: str) -> None:
    path = tmp_path / name
    path.write_bytes(text)
    with refuses(SourceError, code, path):
        load_label_space(str(path))
