"""A release: what it changes by hand, and whole, in a small repository whose steps are quick."""

from __future__ import annotations

import datetime
import os
import re
import shlex
import subprocess
from pathlib import Path

import click
import pytest
from click.testing import CliRunner
from conftest import REPOSITORY, load_script

RELEASE = load_script("package/release")


@pytest.mark.parametrize("name", RELEASE.PLACES)
def test_the_version_stands_once_in_each_place(name: str) -> None:
    text, pattern = (REPOSITORY / name).read_text("utf-8"), RELEASE.PLACES[name]
    changed = RELEASE.set_version(text, pattern, "7.8.9")
    assert changed.count("7.8.9") == 1
    current = RELEASE.find_version((REPOSITORY / "pyproject.toml").read_text("utf-8"))
    assert RELEASE.set_version(changed, pattern, current) == text


def test_a_version_that_stands_twice_is_refused() -> None:
    with pytest.raises(click.ClickException, match="found 2"):
        RELEASE.set_version("version: 1.0.0\nversion: 1.0.0\n", r"^version: (\S+)$", "1.1.0")


def test_the_changelog_gets_the_version_and_the_day() -> None:
    text = "# Changelog\n\n## Unreleased\n\n- more\n\n## 0.1.0 (2026-01-01)\n"
    dated = RELEASE.date_changelog(text, "7.8.9", datetime.date(2030, 1, 2))
    assert dated == text.replace("Unreleased", "7.8.9 (2030-01-02)")


def test_the_changelog_says_what_is_released() -> None:
    text = (REPOSITORY / "CHANGELOG.md").read_text("utf-8")
    assert text.count("\n## Unreleased\n") <= 1
    assert re.search(r"^## (Unreleased|\d+\.\d+\.\d+ \(\d{4}-\d\d-\d\d\))$", text, re.MULTILINE)


@pytest.mark.parametrize("version", ["1", "v1.2.3", "1.2.3rc1", "1.2.3; rm -rf"])
def test_what_is_no_version_is_refused(version: str) -> None:
    with pytest.raises(click.ClickException, match="expected a version like"):
        RELEASE.require_ready(version)


# The steps of a release, made quick. What happens while one runs is in the variable MEANWHILE, as
# commands of a shell; they run in the worktree and know the checkout as $CHECKOUT.
SMALL = {
    "pyproject.toml": '[project]\nname = "small"\nversion = "0.1.0"\n',
    "CITATION.cff": "title: Small\nversion: 0.1.0\n",
    "CHANGELOG.md": "# Changelog\n\n## Unreleased\n\n- new\n",
    "notes.txt": "a line\n",
    ".gitignore": "dist/\n",
    "Makefile": 'test:\n\t@git rev-parse HEAD > "$$CHECKOUT/../tested"; sh -ec "$$MEANWHILE"\n',
    "scripts/package/try_out.py": """
import re, sys
from pathlib import Path

version = re.findall('"([0-9.]+)"', Path("pyproject.toml").read_text())[0]
out = Path(sys.argv[2])
out.mkdir()
for end in ("-py3-none-any.whl", ".tar.gz"):
    (out / f"belief_scene_graphs-{version}{end}").write_text(version)
""",
}
TWINE = """
import os, sys
from pathlib import Path

with Path(os.environ["CHECKOUT"], "..", "twine").open("a") as file:
    print(*sys.argv[1:], file=file)
sys.exit(Path(os.environ["CHECKOUT"], "..", "refuse").exists())
"""
FILES = ["belief_scene_graphs-0.2.0-py3-none-any.whl", "belief_scene_graphs-0.2.0.tar.gz"]


@pytest.fixture
def small(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A clean checkout of main, with a place to push to; twine writes down what it is asked for."""
    small, modules = tmp_path / "small", tmp_path / "modules"
    for name, text in SMALL.items():
        (small / name).parent.mkdir(parents=True, exist_ok=True)
        (small / name).write_text(text, "utf-8")
    (modules / "twine").mkdir(parents=True)
    (modules / "twine" / "__main__.py").write_text(TWINE, "utf-8")
    (modules / "twine" / "__init__.py").touch()  # so that it comes before one that is installed
    for name in [name for name in os.environ if name.startswith("GIT_")]:
        monkeypatch.delenv(name)
    monkeypatch.setenv("HOME", str(tmp_path))  # no settings of git but those of this repository
    monkeypatch.setenv("GIT_CONFIG_NOSYSTEM", "1")
    monkeypatch.delenv("XDG_CONFIG_HOME", raising=False)
    monkeypatch.delenv("MAKEFLAGS", raising=False)
    monkeypatch.setenv("PYTHONPATH", str(modules))
    monkeypatch.setenv("TMPDIR", str(tmp_path / "temporary"))
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr(RELEASE.tempfile, "tempdir", str(tmp_path / "temporary"))
    monkeypatch.setenv("CHECKOUT", str(small))
    monkeypatch.setenv("MEANWHILE", "true")
    monkeypatch.setattr(RELEASE, "REPOSITORY", small)
    git(tmp_path, "init --quiet --bare elsewhere")
    git(tmp_path, "init --quiet --initial-branch main small")
    git(small, "config user.name Someone")
    git(small, "config user.email someone@example.org")
    git(small, "remote add origin ../elsewhere")
    git(small, "add --all")
    git(small, "commit --quiet --message first")
    return small


def git(folder: Path, line: str) -> str:
    """Run git in a folder and return what it prints."""
    words = ["git", *shlex.split(line)]
    return subprocess.run(words, cwd=folder, capture_output=True, text=True, check=True).stdout


def release(*words: str) -> tuple[int, str]:
    """Return the exit code of a release and what it says itself; its steps say theirs elsewhere."""
    done = CliRunner().invoke(RELEASE.main, words)
    assert done.exception is None or isinstance(done.exception, SystemExit), done.exception
    return done.exit_code, done.output


def state(small: Path) -> dict[str, object]:
    """Return all that a release could change, but for what git keeps unnamed."""
    return {
        "refs": git(small, "for-each-ref"),
        "branch": git(small, "symbolic-ref HEAD"),
        "changes": git(small, "status --porcelain"),
        "worktrees": git(small, "worktree list"),
        "temporary": list((small.parent / "temporary").iterdir()),
        "files": {
            path: path.read_bytes()
            for path in small.rglob("*")
            if path.is_file() and ".git" not in path.parts
        },
        "pushed": git(small.parent / "elsewhere", "for-each-ref"),
    }


def test_a_release_is_a_commit_a_tag_and_files_and_is_published_nowhere(small: Path) -> None:
    (small / "dist").mkdir()
    (small / "dist" / "belief_scene_graphs-0.1.0.tar.gz").write_text("of old")
    before = state(small)
    code, said = release("0.2.0")
    assert code == 0, said
    assert git(small, "log --format=%s") == "Version 0.2.0\nfirst\n"
    assert git(small, "show --stat --format= --name-only HEAD").split() == [
        "CHANGELOG.md",
        "CITATION.cff",
        "pyproject.toml",
    ]
    assert 'version = "0.2.0"' in (small / "pyproject.toml").read_text("utf-8")
    assert "version: 0.2.0" in (small / "CITATION.cff").read_text("utf-8")
    assert re.search(r"^## 0\.2\.0 \(", (small / "CHANGELOG.md").read_text("utf-8"), re.MULTILINE)
    assert git(small, "cat-file -t v0.2.0") == "tag\n"
    held = {path.name: path.read_text("utf-8") for path in (small / "dist").iterdir()}
    assert held == {**dict.fromkeys(FILES, "0.2.0"), "belief_scene_graphs-0.1.0.tar.gz": "of old"}
    head = git(small, "rev-parse HEAD")
    assert git(small, "rev-parse v0.2.0^{commit}") == head
    assert (small.parent / "tested").read_text("utf-8") == head, "the tests ran on another commit"
    assert (small.parent / "twine").read_text("utf-8").startswith("check --strict ")
    assert (small.parent / "twine").read_text("utf-8").count("\n") == 1
    for part in ("branch", "changes", "temporary", "pushed"):
        assert state(small)[part] == before[part], part
    assert git(small, "worktree list").count("\n") == 1
    assert (
        f"git push origin main v0.2.0 && python -m twine upload dist/{FILES[0]} dist/{FILES[1]}\n"
        in said
    )


def test_what_is_printed_takes_a_release_back_and_loses_nothing(small: Path) -> None:
    before = state(small)["files"]
    _, said = release("0.2.0")
    (small / "later.txt").write_text("made after the release")
    git(small, "add later.txt")
    git(small, "commit --quiet --message later")
    (small / "notes.txt").write_text("not committed")
    line = re.findall(r"^  (git tag .*)$", said, re.MULTILINE)[0]
    subprocess.run(line, shell=True, cwd=small, check=True, capture_output=True)
    after = state(small)["files"]
    assert after == {
        **before,
        small / "later.txt": b"made after the release",
        small / "notes.txt": b"not committed",
    }
    assert git(small, "tag --list") == ""
    git(small, "checkout --quiet notes.txt")
    assert release("0.2.0")[0] == 0, "it can be released again"


@pytest.mark.parametrize(
    ("words", "before", "message"),
    [
        (("0.0.9",), "true", "is lower than 0.1.0"),
        (("0.2.0",), "echo more >> notes.txt", "the checkout has changes"),
        (("0.2.0",), "git checkout --quiet -b side", "found side; switch to main"),
        (("0.2.0",), "git tag v0.2.0", "v0.2.0 is tagged already"),
        (("0.2.0",), "git rm --quiet --cached CHANGELOG.md; git commit -qm x", "has changes"),
        (
            ("0.2.0",),
            "sed -i.old s/Unreleased/0.1.0/ CHANGELOG.md; rm *.old; git commit -qam x",
            "nothing to release",
        ),
        (
            ("0.2.0",),
            "mkdir dist; echo mine > dist/belief_scene_graphs-0.2.0.tar.gz",
            "dist has belief_scene_graphs-0.2.0.tar.gz already; move them away",
        ),
    ],
)
def test_a_checkout_that_is_not_ready_is_refused_as_it_is(
    words: tuple[str, ...], before: str, message: str, small: Path
) -> None:
    subprocess.run(before, shell=True, cwd=small, check=True)
    was = state(small)
    code, said = release(*words)
    assert (code, message in said) == (1, True), said
    assert state(small) == was
    assert not (small.parent / "tested").exists()


# What someone does in the checkout while a release runs; then the release fails, or is refused.
MEANWHILE = {
    "a test fails": ("false", "make test failed; your checkout is as it was"),
    "an edit": ('echo mine > "$CHECKOUT/notes.txt"; false', "make test failed"),
    "a commit": ('cd "$CHECKOUT"; git commit -q --allow-empty -m mine', "main has moved"),
    "a commit, and a failure": (
        'cd "$CHECKOUT"; git commit -q --allow-empty -m mine; false',
        "make test failed",
    ),
    "a step back": (
        'cd "$CHECKOUT"; git commit -q --amend -m mine',
        "main has moved",
    ),
    "another branch": ('cd "$CHECKOUT"; git checkout -q -b side', "found side; switch to main"),
    "the same file": ('echo mine >> "$CHECKOUT/CHANGELOG.md"', "merge --quiet --ff-only"),
    "the same tag": ('cd "$CHECKOUT"; git tag v0.2.0', "git tag --annotate"),
    "the same file in dist": (
        f'mkdir "$CHECKOUT/dist"; echo mine > "$CHECKOUT/dist/{FILES[1]}"',
        f"has {FILES[1]} already",
    ),
    "twine refuses": ('touch "$CHECKOUT/../refuse"', "twine check"),
}


@pytest.mark.parametrize("case", MEANWHILE)
def test_a_release_that_fails_leaves_what_was_done_meanwhile_and_nothing_else(
    case: str, small: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    meanwhile, message = MEANWHILE[case]
    # When the step ends, the checkout is copied: this is how it has to be in the end.
    monkeypatch.setenv(
        "MEANWHILE",
        f"""trap 'cp -R "$CHECKOUT" "$CHECKOUT/../wanted"' EXIT; {meanwhile}""",
    )
    code, said = release("0.2.0")
    assert (code, message in said) == (1, True), said
    wanted = small.parent / "wanted"
    git(wanted, "worktree prune --expire now")
    assert git(small, "for-each-ref") == git(wanted, "for-each-ref")
    for line in ("symbolic-ref HEAD", "status --porcelain", "diff"):
        assert git(small, line) == git(wanted, line)
    assert names_and_bytes(small) == names_and_bytes(wanted)
    assert git(small, "worktree list").count("\n") == 1
    assert list((small.parent / "temporary").iterdir()) == []


def names_and_bytes(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file() and ".git" not in path.relative_to(folder).parts
    }


def test_without_a_name_for_commits_nothing_changes(small: Path) -> None:
    git(small, "config user.useConfigOnly true")
    git(small, "config --unset user.name")
    git(small, "config --unset user.email")
    before = state(small)
    code, said = release("0.2.0")
    assert (code, "git commit" in said) == (1, True), said
    assert state(small) == before


def test_an_edit_of_another_file_stays_and_is_not_released(
    small: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MEANWHILE", 'echo mine > "$CHECKOUT/notes.txt"')
    assert release("0.2.0")[0] == 0
    assert (small / "notes.txt").read_text("utf-8") == "mine\n"
    assert git(small, "show v0.2.0:notes.txt") == "a line\n"


def test_tests_can_be_left_out(small: Path) -> None:
    assert release("0.2.0", "--skip-tests")[0] == 0
    assert not (small.parent / "tested").exists()


def test_real_data_beside_the_repository_are_beside_the_worktree(
    small: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (small.parent / "shared").mkdir()
    (small.parent / "shared" / "kept").touch()
    monkeypatch.setenv("MEANWHILE", "test -e ../shared/kept")
    assert release("0.2.0")[0] == 0
    assert (small.parent / "shared" / "kept").exists()
