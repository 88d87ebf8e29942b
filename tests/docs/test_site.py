"""The site is built strictly: no dead link, no page that nothing leads to, every public name."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
import zlib
from pathlib import Path

import pytest
from conftest import REPOSITORY, load_script

import bsg_data
import bsg_models
import bsg_robot

if sys.version_info < (3, 11):
    pytest.skip("`make site` needs Python 3.11", allow_module_level=True)

PAGES = load_script("site/pages")


def make_site(*options: str) -> subprocess.CompletedProcess[str]:
    """Run the command of `make site`, with more options."""
    makefile = (REPOSITORY / "Makefile").read_text("utf-8")
    (line,) = re.findall(r"^site:.*\n\t(.*\bmkdocs build\b.*)$", makefile, re.MULTILINE)
    words = shlex.split(line.replace("$(BIN)/", f"{shlex.quote(sys.executable)} -m "))
    command = ["env", *words, *options]
    return subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site, as `make site` builds it."""
    folder = tmp_path_factory.mktemp("site")
    done = make_site("--site-dir", str(folder))
    assert done.returncode == 0, done.stderr
    return folder


@pytest.mark.heavy
def test_a_dead_link_stops_the_command(tmp_path: Path) -> None:
    """A site of one page, with our settings and none of our pages."""
    config = f"INHERIT: {REPOSITORY}/mkdocs.yml\nnav: [index.md]\nhooks: []\nplugins: []\n"
    (tmp_path / "mkdocs.yml").write_text(config, "utf-8")
    (tmp_path / "docs").mkdir()
    text = "# A page\n\n[here](index.md#a-page) [dead](nix.md) [dead](index.md#nope)\n"
    (tmp_path / "docs" / "index.md").write_text(text, "utf-8")
    done = make_site("--config-file", str(tmp_path / "mkdocs.yml"))
    assert done.returncode != 0
    assert "'nix.md', but the target is not found" in done.stderr
    assert "'index.md#nope', but there is no such anchor" in done.stderr
    assert "a-page" not in done.stderr


@pytest.mark.heavy
def test_code_that_a_page_links_to_is_a_page_and_a_file(site: Path) -> None:
    folder = site / "source" / "docs" / "examples"
    kept = (REPOSITORY / "docs" / "examples" / "ros_client.py").read_text("utf-8")
    assert (folder / "ros_client.py").read_text("utf-8") == kept
    page = (folder / "ros_client.py.html").read_text("utf-8")
    assert '<a href="ros_client.py">Download this file</a>' in page


def read_inventory(site: Path) -> set[str]:
    """Return the names of Python that the site has a place for: Sphinx's inventory, version 2."""
    head, body = (site / "objects.inv").read_bytes().split(b"zlib.\n", 1)
    assert head.startswith(b"# Sphinx inventory version 2")
    lines = zlib.decompress(body).decode().splitlines()
    return {line.split()[0] for line in lines if " py:" in line}


@pytest.mark.heavy
def test_every_public_name_has_a_place(site: Path) -> None:
    listed = read_inventory(site)
    assert {f"bsg_robot.{name}" for name in bsg_robot.__all__} <= listed
    for package in (bsg_data, bsg_models):
        assert len(package.__all__) > 30
        own = {*package.__all__} - {*bsg_robot.__all__}
        assert {f"{package.__name__}.{name}" for name in own} <= listed


@pytest.mark.heavy
def test_nothing_is_loaded_from_elsewhere(site: Path) -> None:
    """A page on a disk, without a network, is whole; links may lead elsewhere."""
    loaded = re.compile(r"<(?:script|img|link|iframe)\b[^>]*?(?:src|href)=\"?(https?://[^\">\s]+)")
    found = {
        (path.relative_to(site).as_posix(), address)
        for path in site.rglob("*.html")
        for address in loaded.findall(path.read_text("utf-8"))
    }
    assert found == set()


@pytest.mark.heavy
def test_one_file_has_all_prose(site: Path) -> None:
    """Every page of docs/, whole, and those that lie elsewhere; not the Python reference."""
    text = (site / "llms.txt").read_text("utf-8")
    pages = [*(REPOSITORY / "docs").rglob("*.md"), REPOSITORY / "README.md"]
    assert [page.name for page in pages if page.read_text("utf-8").strip() not in text] == []
    assert "::: bsg_data" not in text


@pytest.mark.parametrize(
    ("place", "link", "expected"),
    [
        ("index.md", "docs/robot.md#say-what-was-seen", "robot.md#say-what-was-seen"),
        ("index.md", "mappings/README.md", "class-maps.md"),
        ("index.md", "NOTICE", "NOTICE.txt"),
        ("class-maps.md", "../docs/format.md", "format.md"),
        ("class-maps.md", "hm3d-wide-v1.md", "class-maps/hm3d-wide-v1.md"),
        ("tutorials/data.md", "../../mappings/README.md", "../class-maps.md"),
        ("robot.md", "https://example.org/docs/x.md", "https://example.org/docs/x.md"),
        ("robot.md", "#ask", "#ask"),
        ("models.md", "../bsg_models/ceci/gcn.py", "source/bsg_models/ceci/gcn.py.md"),
    ],
)
def test_links_lead_to_where_files_are_on_the_site(place: str, link: str, expected: str) -> None:
    assert PAGES.rewrite_links(f"[x]({link})", place) == f"[x]({expected})"
