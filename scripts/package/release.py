"""Prepare a release: version, changelog, checks, files, tag. Nothing is uploaded.

    python scripts/package/release.py 0.2.0

It needs a clean checkout of main, and works in a temporary worktree: the version and the changelog
are committed there, and this commit is checked, built and tried. Only if all went well do the
commit, the tag and the files in `dist` come into the checkout. If not, the checkout is as it was,
with what you changed meanwhile. The last lines say how to publish the release, and how to take it
back.
"""

from __future__ import annotations

import contextlib
import datetime
import re
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import click

REPOSITORY = Path(__file__).resolve().parents[2]
NAME = "belief_scene_graphs"
VERSION = re.compile(r"\d+\.\d+\.\d+")
# where the version stands, and how
PLACES = {
    "pyproject.toml": r'^version = "([^"]+)"$',
    "CITATION.cff": r"^version: (\S+)$",
}


@click.command(help=__doc__, context_settings={"help_option_names": ["-h", "--help"]})
@click.argument("version")
@click.option("--skip-tests", is_flag=True, help="Do not run `make test` on what is released.")
def main(version: str, skip_tests: bool) -> None:
    """Prepare the release of a version."""
    require_ready(version)
    before = tell("git", "rev-parse", "main")
    with temporary_worktree(before) as source:
        commit = commit_version(source, version)
        if not skip_tests:
            run("make", "test", at=source)
        built = source / "dist"
        run(sys.executable, "scripts/package/try_out.py", "--out", str(built), at=source)
        files = sorted(built.glob(f"{NAME}-{version}*"))
        run(sys.executable, "-m", "twine", "check", "--strict", *map(str, files))
        accept(version, files, commit=commit, before=before)
    names = shlex.join(f"dist/{path.name}" for path in files)
    print(f"\nv{version} is tagged, and its files are in dist. To publish them:")
    print(f"  git push origin main v{version} && python -m twine upload {names}")
    print("To take it back before that:")
    print(f"  git tag --delete v{version} && git revert --no-edit {commit} && rm {names}")


@contextlib.contextmanager
def temporary_worktree(commit: str) -> Iterator[Path]:
    """Yield a worktree of the repository at a commit; it has the settings of git, and no branch."""
    with tempfile.TemporaryDirectory() as name:
        source, shared = Path(name, "source"), REPOSITORY.parent / "shared"
        if shared.is_dir():  # tests look for real data beside the repository
            Path(name, "shared").symlink_to(shared)
        run("git", "worktree", "add", "--quiet", "--detach", str(source), commit)
        try:
            yield source
        finally:
            run("git", "worktree", "remove", "--force", str(source))


def commit_version(source: Path, version: str) -> str:
    """Set the version, date the changelog, and return the commit of both."""
    for name, pattern in PLACES.items():
        path = source / name
        path.write_text(set_version(path.read_text("utf-8"), pattern, version), "utf-8")
    changelog = source / "CHANGELOG.md"
    today = datetime.datetime.now(datetime.timezone.utc).date()
    changelog.write_text(date_changelog(changelog.read_text("utf-8"), version, today), "utf-8")
    run("git", "commit", "--quiet", "--all", "--message", f"Version {version}", at=source)
    return tell("git", "rev-parse", "HEAD", at=source)


def accept(version: str, files: list[Path], *, commit: str, before: str) -> None:
    """Bring the tag, the files and, last, the commit into the checkout: all of them, or none.

    Raises:
        ClickException: if main or `dist` is not as it was, saying what is there.
    """
    require_main()
    if tell("git", "rev-parse", "main") != before:
        raise click.ClickException(
            f"main has moved from {before[:12]} since this began, so nothing was released; run the "
            "same command again to release what main is now"
        )
    dist = REPOSITORY / "dist"
    require_new(dist, version)
    dist.mkdir(exist_ok=True)
    with contextlib.ExitStack() as undo:
        run("git", "tag", "--annotate", f"v{version}", commit, "--message", f"Version {version}")
        undo.callback(tell, "git", "tag", "--delete", f"v{version}")
        for path in files:
            with (dist / path.name).open("xb") as file:
                undo.callback((dist / path.name).unlink)
                file.write(path.read_bytes())
        run("git", "merge", "--quiet", "--ff-only", commit)
        undo.pop_all()


def require_ready(version: str) -> None:
    """Refuse a version or a checkout that cannot be released.

    Raises:
        ClickException: saying what is wrong.
    """
    if VERSION.fullmatch(version) is None:
        raise click.ClickException(f"{version}: expected a version like 0.2.0")
    current = find_version((REPOSITORY / "pyproject.toml").read_text("utf-8"))
    if tuple(map(int, version.split("."))) < tuple(map(int, current.split("."))):
        raise click.ClickException(f"{version}: is lower than {current}, the present version")
    if tell("git", "status", "--porcelain"):
        raise click.ClickException("the checkout has changes; commit them first")
    require_main()
    if tell("git", "tag", "--list", f"v{version}"):
        raise click.ClickException(f"v{version} is tagged already; choose the next version")
    if "\n## Unreleased\n" not in (REPOSITORY / "CHANGELOG.md").read_text("utf-8"):
        raise click.ClickException("CHANGELOG.md has no part `## Unreleased`: nothing to release")
    require_new(REPOSITORY / "dist", version)


def require_main() -> None:
    """Refuse a checkout of another branch.

    Raises:
        ClickException: naming it.
    """
    branch = tell("git", "rev-parse", "--abbrev-ref", "HEAD")
    if branch != "main":
        raise click.ClickException(f"releases are made on main, found {branch}; switch to main")


def require_new(dist: Path, version: str) -> None:
    """Refuse a folder that has files of the version, which may be someone's only ones.

    Raises:
        ClickException: naming them.
    """
    names = sorted(path.name for path in dist.glob(f"{NAME}-{version}[-.]*"))
    if names:
        raise click.ClickException(f"{dist} has {', '.join(names)} already; move them away first")


def find_version(text: str) -> str:
    """Return the version that pyproject.toml says."""
    return str(re.findall(PLACES["pyproject.toml"], text, re.MULTILINE)[0])


def set_version(text: str, pattern: str, version: str) -> str:
    """Return a file with another version.

    Raises:
        ClickException: if its version does not stand there exactly once.

    >>> set_version('version = "1.0.0"', r'^version = "([^"]+)"$', "1.1.0")
    'version = "1.1.0"'
    """
    found = re.findall(pattern, text, re.MULTILINE)
    if len(found) != 1:
        raise click.ClickException(f"expected one line like {pattern}, found {len(found)}")
    return re.sub(
        pattern, lambda line: line[0].replace(found[0], version), text, flags=re.MULTILINE
    )


def date_changelog(text: str, version: str, today: datetime.date) -> str:
    r"""Return the changelog with what was unreleased under a version and a date.

    >>> date_changelog("## Unreleased\n\n- new\n", "1.0.0", datetime.date(2026, 1, 2))
    '## 1.0.0 (2026-01-02)\n\n- new\n'
    """
    return text.replace("## Unreleased", f"## {version} ({today.isoformat()})", 1)


def run(*words: str, at: Path | None = None) -> None:
    """Run a program, in the checkout if nothing else is said, and show what it prints.

    Raises:
        ClickException: if it fails.
    """
    if subprocess.run(words, cwd=at or REPOSITORY).returncode:
        raise click.ClickException(f"{shlex.join(words)} failed; your checkout is as it was")


def tell(*words: str, at: Path | None = None) -> str:
    """Return what a program prints."""
    done = subprocess.run(words, cwd=at or REPOSITORY, capture_output=True, text=True, check=True)
    return done.stdout.strip()


if __name__ == "__main__":
    main()
