"""The catalogue of sources, and a source of someone else's that is installed beside it."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml
from conftest import write_twelve
from refusals import refuses

from bsg_data import registry
from bsg_data.build import build_dataset
from bsg_data.dataset.card import write_card, write_croissant
from bsg_data.dataset.manifest import read_manifest
from bsg_data.dataset.splits import split_dataset
from bsg_data.errors import SourceError
from bsg_data.recipes import SplitRecipe
from bsg_data.sources.catalogue import SOURCES, find_terms, open_source, parse_options
from bsg_data.sources.hm3d import HM3DFolder
from bsg_data.sources.hm3d_stats import HM3DStatistics
from bsg_data.sources.source import Source, Terms
from bsg_data.synthetic.buildings import write_synthetic

DOLLS = '''
import hashlib
from dataclasses import dataclass
from pathlib import Path
from bsg_data.errors import SourceError
from bsg_data.scene.scene_graph import SceneObject
from bsg_data.sources.assembly import assemble
from bsg_data.sources.source import FoundScenes, Reading, SceneRef, SourceRow, Terms

@dataclass(frozen=True)
class DollsHouses:
    """One `<name>.txt` a house, one line a room, its things with commas between."""

    path: Path
    kind: str = "dolls"

    @property
    def options(self):
        return {}

    def find(self):
        files = sorted(self.path.glob("*.txt"))
        if not files:
            raise SourceError(f"{self.path}: no *.txt there")
        digests = [hashlib.sha256(file.read_bytes()).hexdigest() for file in files]
        return FoundScenes(tuple(
            SceneRef(file.stem, file.name, digest, None, None)
            for file, digest in zip(files, digests)
        ))

    def read(self, ref, class_map):
        lines = (self.path / ref.location).read_text("utf-8").splitlines()
        things = [(name, room) for room, line in enumerate(lines) for name in line.split(",")]
        objects = [SceneObject(0, i, room, name) for i, (name, room) in enumerate(things, 1)]
        return Reading(assemble(
            objects, ref=ref, kind=self.kind, sha256=ref.fingerprint, class_map=class_map
        ))

TERMS = Terms(
    licence="CC-BY-4.0",
    licence_url="https://creativecommons.org/licenses/by/4.0/",
    homepage="https://example.org/dolls",
    citation="Doll et al., Houses, 2020",
    sentence="The houses are under CC BY 4.0: name their makers.",
)
ROW = SourceRow("dolls' houses", DollsHouses, TERMS)
STRANGER = SourceRow("another kind", lambda path: DollsHouses(path, "stranger"), TERMS)
NONE = SourceRow("no source", lambda path: path, TERMS)
'''


@pytest.fixture
def dolls(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A package on `sys.path` with a source of its own; its data, two houses."""
    package = tmp_path / "package"
    info = package / "dolls-1.dist-info"
    info.mkdir(parents=True)
    (package / "dolls_houses.py").write_text(DOLLS, "utf-8")
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: dolls\nVersion: 1\n")
    (info / "entry_points.txt").write_text(
        "[bsg_data.sources]\ndolls = dolls_houses:ROW\nodd = dolls_houses:STRANGER\n"
        "none = dolls_houses:NONE\n"
    )
    monkeypatch.syspath_prepend(str(package))
    registry._installed.cache_clear()
    data = tmp_path / "data"
    data.mkdir()
    (data / "one.txt").write_text("chair,lamp\nbed,pillow,pillow\n", "utf-8")
    (data / "two.txt").write_text("toilet,sink\n", "utf-8")
    yield data
    registry._installed.cache_clear()
    sys.modules.pop("dolls_houses", None)


def test_every_row_opens_a_source_and_has_terms(tmp_path: Path) -> None:
    list(write_synthetic(tmp_path / "synth", scenes=1, seed=0))
    paths = {"hm3d": tmp_path, "hm3d-stats": tmp_path / "x.zip", "synthetic": tmp_path / "synth"}
    for name, path in paths.items():
        assert SOURCES[name].summary
        source = open_source(name, path)
        assert isinstance(source, Source)
        assert (source.kind, source.path) == (name, path)


def test_options_reach_the_source(tmp_path: Path) -> None:
    assert open_source("hm3d", tmp_path, meshes=False) == HM3DFolder(tmp_path, meshes=False)
    assert open_source("hm3d-stats", tmp_path) == HM3DStatistics(tmp_path)
    with refuses(SourceError, "option-unknown", "hm3d"):
        open_source("hm3d", tmp_path, mesh=False)
    with refuses(SourceError, "option-unknown", "hm3d-stats"):
        open_source("hm3d-stats", tmp_path, meshes=False)


def test_real_buildings_are_no_synthetic_ones(tmp_path: Path) -> None:
    with refuses(SourceError, "source-mixed"):
        open_source("synthetic", write_twelve(tmp_path / "real"))


def test_a_source_from_outside_builds_under_its_own_terms(dolls: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    manifest = build_dataset(open_source("dolls", dolls), out)
    assert (manifest.totals.scenes, manifest.totals.rooms, manifest.totals.objects) == (2, 3, 7)
    assert manifest.sources[0].kind == "dolls"
    split_dataset(out, SplitRecipe(ratios=(0.5, 0.5, 0.0)))  # which writes the cards again
    card = (out / "README.md").read_text("utf-8")
    front = yaml.safe_load(card.split("---")[1])
    assert front["license"] == "cc-by-4.0"
    assert "name their makers" in card
    croissant = json.loads((out / "croissant.json").read_text("utf-8"))
    assert croissant["license"] == "https://creativecommons.org/licenses/by/4.0/"
    assert croissant["url"] == "https://example.org/dolls"
    assert croissant["citeAs"] == "Doll et al., Houses, 2020"
    assert "atterport" not in card + json.dumps(croissant)


@pytest.mark.usefixtures("dolls")
@pytest.mark.parametrize("name", ["odd", "none"])
def test_a_row_that_opens_something_else_is_refused(name: str, tmp_path: Path) -> None:
    with refuses(SourceError, "source-foreign", name):
        open_source(name, tmp_path)


def test_a_kind_that_is_no_row_any_more_has_unknown_terms(dataset: Path) -> None:
    manifest = read_manifest(dataset)
    gone = manifest.sources[0].model_copy(update={"kind": "gone", "terms": None})
    manifest = manifest.model_copy(update={"sources": (gone,)})
    card, croissant = write_card(manifest), json.loads(write_croissant(manifest))
    assert find_terms("gone") is None
    assert yaml.safe_load(card.split("---")[1])["license"] == "unknown"
    assert "gone: the source is of unknown terms: ask whoever made it." in card
    assert croissant["license"] == "unknown terms: ask whoever made it"
    assert "url" not in croissant
    assert "citeAs" not in croissant
    assert "atterport" not in card + json.dumps(croissant)


def test_words_become_what_a_source_takes() -> None:
    assert parse_options("behavior", {"as_listed": "Yes"}) == {"as_listed": True}
    assert parse_options("hm3d", {"meshes": "0", "snap_colours": "8"}) == {
        "meshes": False,
        "snap_colours": 8,
    }
    assert parse_options("table", {"licence": "1"}) == {"licence": "1"}
    assert parse_options("procthor", {}) == {}


@pytest.mark.parametrize(
    ("source", "words", "code"),
    [
        ("behavior", {"aslisted": "yes"}, "option-unknown"),
        ("table", {"path": "x"}, "option-unknown"),
        ("behavior", {"as_listed": "2"}, "option-malformed"),
        ("hm3d", {"snap_colours": "eight"}, "option-malformed"),
    ],
)
def test_options_that_a_source_does_not_take(source: str, words: dict[str, str], code: str) -> None:
    with refuses(SourceError, code):
        parse_options(source, words)


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
    assert Terms(**terms).licence == "MIT"
    with refuses(SourceError, "terms-malformed", field, golden=False):
        Terms(**{**terms, field: value})
