"""What users are told to install is there: an extra of ours, from a place and not from an index."""

from __future__ import annotations

import re

from conftest import REPOSITORY, tomllib

from bsg_data.errors import ask_to_install

CODE = [
    path
    for folder in ("bsg_data", "bsg_models", "cli", "scripts")
    for path in sorted((REPOSITORY / folder).rglob("*.py"))
]
PAGES = [*REPOSITORY.glob("*.md"), *(REPOSITORY / "docs").rglob("*.md")]
ASKED = re.compile(r"""ask_to_install\(["'](\w+)["']\)""")
BY_BARE_NAME = re.compile(r"pip install[^\n`]*[\s'\"]belief-scene-graphs\b")


def test_each_extra_that_code_asks_for_is_one_of_ours() -> None:
    with (REPOSITORY / "pyproject.toml").open("rb") as file:
        extras = tomllib.load(file)["project"]["optional-dependencies"]
    asked = {extra for path in CODE for extra in ASKED.findall(path.read_text("utf-8"))}
    assert asked == {"all", "cluster", "figures", "hub", "hydra", "models"}
    assert asked <= extras.keys()
    assert ask_to_install("hub").startswith("pip install './belief-scene-graphs[hub]'")


def test_nothing_is_installed_by_the_bare_name() -> None:
    """The package is on no index: the name fails there, or is a stranger's."""
    texts = {str(path): path.read_text("utf-8") for path in [*CODE, *PAGES]}
    assert BY_BARE_NAME.search("pip install torch 'belief-scene-graphs[models]'")
    assert [name for name, text in texts.items() if BY_BARE_NAME.search(text)] == []


def test_no_page_names_a_file_of_one_version() -> None:
    """The next release makes another file."""
    texts = {str(path): path.read_text("utf-8") for path in PAGES}
    assert len(texts) > 30
    assert [
        name for name, text in texts.items() if re.search(r"belief_scene_graphs-\d", text)
    ] == []
