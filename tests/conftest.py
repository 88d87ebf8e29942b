"""Fixtures of all tests: buildings written out by hand, and the real data where it is."""

from __future__ import annotations

import contextlib
import hashlib
import importlib
import importlib.metadata
import importlib.util
import json
import re
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import hypothesis
import pytest

from bsg_data import PairsRecipe, SplitRecipe, build_dataset, split_dataset, write_pairs
from bsg_data.dataset.manifest import (
    MANIFEST,
    FileEntry,
    Manifest,
    encode_manifest,
)
from bsg_data.seal import write_seal
from bsg_data.sources.hm3d import HM3DFolder

hypothesis.settings.register_profile("untimed", deadline=None)  # a busy machine proves nothing
hypothesis.settings.load_profile("untimed")
REPOSITORY = Path(__file__).resolve().parent.parent
# Python 3.10 has no reader of TOML; tomli is the one that later Pythons took over.
tomllib = importlib.import_module("tomllib" if sys.version_info >= (3, 11) else "tomli")
SHARED = REPOSITORY.parent / "shared" / "hm3d"


@pytest.fixture(scope="session")
def stride(request: pytest.FixtureRequest) -> int:
    """Return the step between the moments at which a test kills: each with --full, else a third."""
    return 1 if request.config.getoption("--full") else 3


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add what `make faults` asks for."""
    parser.addoption("--full", action="store_true", help="tests/faults: try everything")


@contextlib.contextmanager
def working_in(folder: Path) -> Iterator[None]:
    """Work in a folder; `contextlib.chdir` is of Python 3.11."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        yield


def read_pins(name: str) -> dict[str, str]:
    """Return the versions that a file of requirements pins."""
    text = (REPOSITORY / name).read_text("utf-8")
    return dict(re.findall(r"^([A-Za-z0-9-]+)==([^\s\\]+)", text, re.MULTILINE))


def list_unpinned(*packages: str) -> str:
    """Say which of the packages are installed in another version than `constraints.txt` pins."""
    pins = read_pins("constraints.txt")
    found = {name: importlib.metadata.version(name).partition("+")[0] for name in packages}
    return ", ".join(f"{name} {found[name]}" for name in packages if found[name] != pins[name])


KITCHEN = ["wall", "floor", "stove", "refrigerator", "sink", "kitchen cabinet", "chair", "chair"]
BEDROOM = ["wall", "floor", "bed", "pillow", "pillow", "wardrobe", "lamp", "curtain", "zzqx thing"]
BATHROOM = ["wall", "floor", "toilet", "sink", "mirror", "bathtub", "towel", "unknown", ""]


def annotation_text(rooms: dict[int, list[str]]) -> str:
    """Return HM3D's annotation text of one building: region id → names."""
    rows = [(name, region) for region, names in rooms.items() for name in names]
    lines = [f'{i},{i * 4099:06X},"{name}",{region}' for i, (name, region) in enumerate(rows, 1)]
    return "\n".join(["HM3D Semantic Annotations", *lines]) + "\n"


def write_scene(root: Path, scene_id: str, text: str | bytes, *, split: str = "train") -> Path:
    """Write one building into a folder laid out as HM3D's."""
    path = root / split / scene_id / f"{scene_id.partition('-')[2]}.semantic.txt"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def write_twelve(root: Path) -> Path:
    """Write twelve small buildings; number k has k bedrooms, and two objects in no room."""
    for k in range(12):
        rooms = {0: KITCHEN, 3: BATHROOM, -1: ["book", "cup"]}
        rooms |= {10 + i: BEDROOM for i in range(k)}
        split = "val" if k % 4 == 3 else "train"
        write_scene(
            root,
            f"{k + (800 if split == 'val' else 0):05d}-abcdefghi{k:02d}",
            annotation_text(rooms),
            split=split,
        )
    return root


def describe_file(folder: Path, path: str, *, rows: int) -> FileEntry:
    """Return the manifest's entry of a file that a test wrote."""
    data = (folder / path).read_bytes()
    sha256 = hashlib.sha256(data).hexdigest()
    return FileEntry(path=path, rows=rows, bytes=len(data), sha256=sha256)


def commit_manifest(dataset: Path, manifest: Manifest) -> None:
    """Write a manifest by hand."""
    (dataset / MANIFEST).write_bytes(encode_manifest(manifest))


def load_script(name: str) -> ModuleType:
    """Return a script as a module, by its path below `scripts/` without its suffix."""
    spec = importlib.util.spec_from_file_location(
        name.replace("/", "_"), REPOSITORY / "scripts" / f"{name}.py"
    )
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def hm3d_folder(tmp_path: Path) -> Path:
    """The twelve buildings, in a folder of the test's own."""
    return write_twelve(tmp_path / "hm3d")


@pytest.fixture(scope="session")
def _dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("session")
    out = folder / "dataset"
    build_dataset(HM3DFolder(write_twelve(folder / "hm3d")), out, scenes_per_shard=5)
    split_dataset(out, SplitRecipe())
    write_pairs(out, PairsRecipe(draws=4))
    return out


@pytest.fixture
def dataset(_dataset: Path, tmp_path: Path) -> Path:
    """A dataset of the twelve buildings, split, with four draws; each test has its own copy."""
    return Path(shutil.copytree(_dataset, tmp_path / "dataset"))


@pytest.fixture(scope="session")
def _run(_dataset: Path) -> Path:
    # Imported here: torch takes seconds, and the tests of bsg_data need none.
    from bsg_models.training.training import train_run
    from bsg_models.zoo.config import find_config

    list(train_run(find_config("gamma-poisson"), _dataset, _dataset.parent / "run"))
    return _dataset.parent / "run"


@pytest.fixture
def run(_run: Path, tmp_path: Path) -> Path:
    """A run of `gamma-poisson`, trained on `dataset`; each test has its own copy."""
    return Path(shutil.copytree(_run, tmp_path / "run"))


@pytest.fixture(scope="session")
def board(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished leaderboard of two models on the twelve buildings in three folds: only read it."""
    from bsg_models.studies.leaderboard import LeaderboardRecipe, make_leaderboard
    from bsg_models.studies.leaderboard_report import REPORT, write_json
    from bsg_models.zoo.config import find_config, override, validate_config

    folder = tmp_path_factory.mktemp("board")
    build_dataset(HM3DFolder(write_twelve(folder / "hm3d")), folder / "dataset")
    small = ["model.types=2", "model.iterations=5", "model.calibrate=false"]
    tables = override(find_config("mixture").model_dump(mode="json"), small)
    models = {
        "gamma-poisson": find_config("gamma-poisson"),
        "mixture": validate_config(tables, source="test"),
    }
    recipe = LeaderboardRecipe(folds=3, draws=2, resamples=3)
    made = make_leaderboard(folder / "dataset", folder / "board", models, recipe)
    (folder / "board" / REPORT).write_text(json.dumps(write_json(made)), "utf-8")
    return folder / "board"


@pytest.fixture
def shipped(_run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of shipped models that is taken for that of the package: `universal`, and `other`.

    Both are the run of `gamma-poisson`.
    """
    from bsg_models.runs import found_model
    from bsg_models.runs.checkpoint_file import read_fields
    from bsg_models.runs.model_card import ModelCard, write_card
    from bsg_models.runs.run_folder import TrainedOn

    folder = tmp_path / "weights"
    folder.mkdir()
    fields = read_fields(_run / "best.safetensors")
    for name in ("universal", "other"):
        shutil.copy(_run / "best.safetensors", folder / f"{name}.safetensors")
        trained_on = (TrainedOn(source="synthetic", buildings=12, licence="Apache-2.0"),)
        card = ModelCard(name=name, purpose="For tests.", trained_on=trained_on)
        (folder / f"{name}.md").write_text(write_card(card, fields=fields), "utf-8")
    names = [f"{name}{end}" for name in ("universal", "other") for end in (".safetensors", ".md")]
    write_seal(folder, names)
    monkeypatch.setattr(found_model, "weights_folder", lambda: folder)
    return folder


@pytest.fixture
def shared() -> Path:
    """The real annotations, where this machine has them."""
    if not SHARED.is_dir():
        pytest.skip("../shared/hm3d is not on this machine")
    return SHARED
