"""The site is built strictly: no dead link, no page that nothing leads to, every public name."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import zlib
from pathlib import Path

import pytest
from conftest import REPOSITORY, load_script

import bsg_data
import bsg_models

PAGES = load_script("site/pages")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site, as `make site` builds it."""
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder)]
    environment = {**os.environ, "NO_MKDOCS_2_WARNING": "1"}
    done = subprocess.run(command, cwd=REPOSITORY, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return folder


def read_inventory(site: Path) -> set[str]:
    """Return the names of Python that the site has a place for: Sphinx's inventory, version 2."""
    head, body = (site / "objects.inv").read_bytes().split(b"zlib.\n", 1)
    assert head.startswith(b"# Sphinx inventory version 2")
    lines = zlib.decompress(body).decode().splitlines()
    return {line.split()[0] for line in lines if " py:" in line}


@pytest.mark.slow
def test_every_public_name_has_a_place(site: Path) -> None:
    listed = {name.rpartition(".")[2] for name in read_inventory(site)}
    for package in (bsg_data, bsg_models):
        assert len(package.__all__) > 80
        assert set(package.__all__) - listed == set()


@pytest.mark.slow
def test_every_page_is_in_the_search(site: Path) -> None:
    index = (site / "search" / "search_index.json").read_text("utf-8")
    for page in (
        "tutorials/robot.html",
        "faq.html",
        "class-maps.html",
        "model-cards/universal.html",
    ):
        assert f'"location":"{page}' in index.replace(" ", ""), page


@pytest.mark.slow
def test_nothing_is_loaded_from_elsewhere(site: Path) -> None:
    """A page on a disk, without a network, is whole; links may lead elsewhere."""
    loaded = re.compile(r"<(?:script|img|link|iframe)\b[^>]*?(?:src|href)=\"?(https?://[^\">\s]+)")
    found = {
        (path.relative_to(site).as_posix(), address)
        for path in site.rglob("*.html")
        for address in loaded.findall(path.read_text("utf-8"))
    }
    assert found == set()


def test_every_room_has_a_page_and_every_name_is_on_one() -> None:
    rooms = PAGES.public_names()
    listed = {name.rpartition(".")[2] for names in rooms.values() for name in names}
    assert set(bsg_data.__all__) | set(bsg_models.__all__) <= listed
    assert {"bsg_data", "bsg_data.scene", "bsg_models.zoo", "bsg_models.testing"} <= set(rooms)


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
        ("models.md", "../bsg_models/zoo/gcn.py", "source/bsg_models/zoo/gcn.py.md"),
    ],
)
def test_links_lead_to_where_files_are_on_the_site(place: str, link: str, expected: str) -> None:
    assert PAGES.rewrite_links(f"[x]({link})", place) == f"[x]({expected})"


def test_pictures_of_a_notebook_get_its_words_in_their_order() -> None:
    cells = [{"metadata": {"alt": words}} for words in ("a < b", "bars")]
    before = f'<img alt="{PAGES._NO_WORDS}">'
    page = PAGES.describe_pictures(before * 2, {"cells": [*cells, {"metadata": {}}]})
    assert page == '<img alt="a &lt; b"><img alt="bars">'


@pytest.mark.slow
def test_no_picture_of_the_site_lacks_words(site: Path) -> None:
    lacking = [path.name for path in site.rglob("*.html") if PAGES._NO_WORDS in path.read_text()]
    assert lacking == []


def test_a_notebook_can_be_downloaded_from_its_page() -> None:
    page = PAGES.offer_notebook("<h1>Ask</h1>\n<h1>Again</h1>", "ask.ipynb")
    title, rest = page.split("\n")
    assert title.startswith('<h1>Ask</h1><p><a href="ask.ipynb" download>')
    assert rest == "<h1>Again</h1>"
    assert "include_source: true" in (REPOSITORY / "mkdocs.yml").read_text("utf-8")
