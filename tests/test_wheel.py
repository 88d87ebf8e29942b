"""What is installed from a wheel is what lies in the source tree, and it works alone.

The wheel is built from the source archive, as `python -m build` does.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest
from conftest import REPOSITORY, tomllib

FOLDERS = {
    "bsg_cli": "cli",
    "bsg_data": "bsg_data",
    "bsg_mappings": "mappings",
    "bsg_models": "bsg_models",
    "bsg_robot": "bsg_robot",
    "bsg_weights": "weights",
}
BUILD = "import sys; from setuptools.build_meta import {0}; {0}(sys.argv[1])"
BESIDE = (  # what the source archive has besides the packages, and what setuptools writes itself
    *("pyproject.toml", "MANIFEST.in"),
    *("README.md", "LICENSE", "NOTICE", "CHANGELOG.md", "CITATION.cff"),
)
WRITTEN = {"PKG-INFO", "setup.cfg"}
IMPORT = """
import sys
import bsg_data, bsg_models, bsg_models.zoo.catalogue, bsg_cli.registry
packages = ("bsg_data", "bsg_models", "bsg_robot", "bsg_cli")
ours = [module for name, module in sys.modules.items() if name.split(".")[0] in packages]
elsewhere = [m.__file__ for m in ours if not m.__file__.startswith(sys.argv[1])]
assert not elsewhere, elsewhere
"""


def source_files() -> dict[str, Path]:
    """Return every file of the packages by its name in the wheel."""
    return {
        f"{package}/{path.relative_to(REPOSITORY / folder).as_posix()}": path
        for package, folder in FOLDERS.items()
        for path in (REPOSITORY / folder).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }


def test_the_listed_packages_are_the_folders_of_code() -> None:
    with (REPOSITORY / "pyproject.toml").open("rb") as file:
        listed = tomllib.load(file)["tool"]["setuptools"]["packages"]
    folders = {
        name.rpartition("/")[0].replace("/", ".") for name in source_files() if name.endswith(".py")
    }
    assert listed == sorted(folders | {"bsg_mappings"})


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The source archive, built without a network."""
    return build_archive(tmp_path_factory.mktemp("archive"))


@pytest.fixture(scope="module")
def wheel(archive: Path) -> Path:
    """The wheel of the source archive."""
    return build_wheel(archive)


def build_archive(folder: Path) -> Path:
    """Build from a copy, which has tests too: the build leaves files beside the sources."""
    copy = folder / "copy"
    for source in (*FOLDERS.values(), "tests"):
        hidden = shutil.ignore_patterns("__pycache__")
        shutil.copytree(REPOSITORY / source, copy / source, ignore=hidden)
    for name in BESIDE:
        shutil.copy(REPOSITORY / name, copy)
    return build("build_sdist", copy, folder)


def build_wheel(archive: Path) -> Path:
    folder = archive.parent / "unpacked"
    with tarfile.open(archive) as file:
        for one in filter(tarfile.TarInfo.isfile, file):
            held = file.extractfile(one)
            assert held is not None
            (folder / one.name).parent.mkdir(parents=True, exist_ok=True)
            (folder / one.name).write_bytes(held.read())
    (source,) = folder.iterdir()
    return build("build_wheel", source, archive.parent)


def build(what: str, source: Path, folder: Path) -> Path:
    """Build one of the files that packages are published as."""
    before = set(folder.iterdir())
    command = [sys.executable, "-c", BUILD.format(what), str(folder)]
    done = subprocess.run(command, cwd=source, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    (path,) = set(folder.iterdir()) - before
    return path


@pytest.mark.heavy
def test_the_wheel_holds_every_file_of_the_packages(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        held = {name for name in archive.namelist() if ".dist-info/" not in name}
        assert held == set(source_files())
        for name, path in source_files().items():
            assert archive.read(name) == path.read_bytes(), name


@pytest.mark.heavy
def test_the_wheel_works_without_the_source_tree(wheel: Path, tmp_path: Path) -> None:
    unpacked = tmp_path / "unpacked"
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(unpacked)
    environment = {**os.environ, "PYTHONPATH": str(unpacked)}

    def run(code: str, *words: str) -> str:
        command = [sys.executable, "-c", code, *words]
        done = subprocess.run(
            command, cwd=tmp_path, env=environment, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    run(IMPORT, str(unpacked))
    shown = run("from bsg_cli.data import main; main()", "map", "show", "chair")
    assert "chair" in shown
