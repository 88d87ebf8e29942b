"""The site is built strictly: no dead link, no page that nothing leads to, every public name."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
import zlib
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest
from conftest import REPOSITORY, load_script

import bsg_data
import bsg_models

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
@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("[here](index.md#a-page)", None),
        ("[dead](nix.md)", "'nix.md', but the target is not found"),
        ("[dead](index.md#nope)", "'index.md#nope', but there is no such anchor"),
    ],
)
def test_a_dead_link_stops_the_command(tmp_path: Path, text: str, expected: str | None) -> None:
    """A site of one page, with our settings and none of our pages."""
    config = f"INHERIT: {REPOSITORY}/mkdocs.yml\nnav: [index.md]\nhooks: []\nplugins: []\n"
    (tmp_path / "mkdocs.yml").write_text(config, "utf-8")
    (tmp_path / "docs").mkdir()
    (tmp_path / "docs" / "index.md").write_text(f"# A page\n\n{text}\n", "utf-8")
    done = make_site("--config-file", str(tmp_path / "mkdocs.yml"))
    if expected is None:
        assert done.returncode == 0, done.stderr
    else:
        assert done.returncode != 0
        assert expected in done.stderr


class Page(HTMLParser):
    """The ids of a page, and the targets of its links, pictures, scripts and style sheets."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.ids: set[str] = set()
        self.targets: set[str] = set()
        self.feed(text)

    def handle_starttag(self, _: str, attrs: list[tuple[str, str | None]]) -> None:
        self.ids |= {value for name, value in attrs if name == "id" and value}
        self.targets |= {value for name, value in attrs if name in ("href", "src") and value}


def find_dead_links(site: Path) -> set[tuple[str, str]]:
    """Return page and target of all that leads to no file of the site, or to no id of its page."""
    pages = {path: Page(path.read_text("utf-8")) for path in site.rglob("*.html")}
    dead = set()
    for path, page in pages.items():
        for target in page.targets:
            parts = urlsplit(target)
            if parts.scheme or parts.netloc:
                continue
            # A server shows the page of a missing page at any depth: its links begin with /.
            start = site if parts.path.startswith("/") else path.parent
            place = Path(os.path.normpath(start / unquote(parts.path).lstrip("/")))
            there = place if parts.path else path
            is_file = there.is_relative_to(site) and there.is_file()
            has_id = not parts.fragment or unquote(parts.fragment) in pages.get(there, page).ids
            if not is_file or (there in pages and not has_id):
                dead.add((path.relative_to(site).as_posix(), target))
    return dead


def test_dead_links_are_found(tmp_path: Path) -> None:
    """Each fault beside a link of the same kind that is sound."""
    site = tmp_path / "site"
    (site / "notes").mkdir(parents=True)
    (tmp_path / "outside.html").touch()
    (site / "plan.svg").touch()
    (site / "index.html").write_text(
        '<h1 id="top">x</h1><a href="#top"></a><a href="#gone"></a><img src="plan.svg#part">'
        '<a href="notes/ask.html#é"></a><a href="notes/ask.html#e"></a><a href="nonexist.html">'
        '<a href="https://example.org/x#y"></a><a href="mailto:x@y.z"></a><img src="no.png">'
    )
    (site / "notes" / "ask.html").write_text(
        '<p id="é"><a href="../index.html#top"></a><a href="../robot.md"></a><a href="/plan.svg">'
        '<a href="../index.html#nope2"></a><a href="../../outside.html"></a><a href="/no.svg"></a>'
        '<a href="#%C3%A9"></a><a href="../notes"></a>'
    )
    assert find_dead_links(site) == {
        ("index.html", "#gone"),
        ("index.html", "no.png"),
        ("index.html", "nonexist.html"),
        ("index.html", "notes/ask.html#e"),
        ("notes/ask.html", "../../outside.html"),
        ("notes/ask.html", "../index.html#nope2"),
        ("notes/ask.html", "../notes"),
        ("notes/ask.html", "../robot.md"),
        ("notes/ask.html", "/no.svg"),
    }


@pytest.mark.heavy
def test_no_link_is_dead(site: Path) -> None:
    """Also those of raw HTML, which mkdocs does not follow."""
    assert len(list(site.rglob("*.html"))) > 80
    assert find_dead_links(site) == set()


@pytest.mark.heavy
def test_code_that_a_page_links_to_is_a_page_and_a_file(site: Path) -> None:
    folder = site / "source" / "docs" / "examples"
    kept = (REPOSITORY / "docs" / "examples" / "ros2_belief_node.py").read_text("utf-8")
    assert (folder / "ros2_belief_node.py").read_text("utf-8") == kept
    page = (folder / "ros2_belief_node.py.html").read_text("utf-8")
    assert '<a href="ros2_belief_node.py">Download this file</a>' in page


def read_inventory(site: Path) -> set[str]:
    """Return the names of Python that the site has a place for: Sphinx's inventory, version 2."""
    head, body = (site / "objects.inv").read_bytes().split(b"zlib.\n", 1)
    assert head.startswith(b"# Sphinx inventory version 2")
    lines = zlib.decompress(body).decode().splitlines()
    return {line.split()[0] for line in lines if " py:" in line}


@pytest.mark.heavy
def test_every_public_name_has_a_place(site: Path) -> None:
    listed = read_inventory(site)
    for package in (bsg_data, bsg_models):
        assert len(package.__all__) > 30
        assert {f"{package.__name__}.{name}" for name in package.__all__} - listed == set()


@pytest.mark.heavy
def test_the_examples_of_docstrings_are_shown_as_code(site: Path) -> None:
    """An example outside `Examples:` becomes quotes; one with a flag of doctest shows the flag."""
    pages = {path.name: path.read_text("utf-8") for path in (site / "api").glob("*.html")}
    assert "predictor" in pages["bsg_models.runs.html"]
    mangled = ("<blockquote", "doctest:")
    assert {name for name, text in pages.items() if any(one in text for one in mangled)} == set()


@pytest.mark.heavy
def test_every_page_is_in_the_search(site: Path) -> None:
    index = (site / "search" / "search_index.json").read_text("utf-8")
    for page in (
        "tutorials/robot.html",
        "faq.html",
        "class-maps.html",
        "model-cards/universal.html",
    ):
        assert f'"location":"{page}' in index.replace(" ", ""), page


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


def test_every_room_has_a_page_and_every_name_is_on_one() -> None:
    rooms = PAGES.public_names()
    every = [name for names in rooms.values() for name in names]
    listed = {f"{name.partition('.')[0]}.{name.rpartition('.')[2]}" for name in every}
    for package in (bsg_data, bsg_models):
        assert {f"{package.__name__}.{name}" for name in package.__all__} - listed == set()
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
