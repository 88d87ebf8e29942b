"""Prepare a release: version, changelog, checks, files, tag. Nothing is uploaded.

    python scripts/package/release.py 0.2.0

It needs a clean checkout of main. Each step is one that can be undone: a commit, a tag and files in
`dist`. The last lines say how to publish them, and how to take them back.
"""

from __future__ import annotations

import datetime
import re
import subprocess
import sys
from pathlib import Path

import click

REPOSITORY = Path(__file__).resolve().parents[2]
VERSION = re.compile(r"\d+\.\d+\.\d+")
# where the version stands, and how
PLACES = {
    "pyproject.toml": r'^version = "([^"]+)"$',
    "CITATION.cff": r"^version: (\S+)$",
}


@click.command(help=__doc__, context_settings={"help_option_names": ["-h", "--help"]})
@click.argument("version")
@click.option("--skip-tests", is_flag=True, help="`make test` was run on this commit.")
def main(version: str, skip_tests: bool) -> None:
    """Prepare the release of a version."""
    require_ready(version)
    if not skip_tests:
        run("make", "test")
    for name, pattern in PLACES.items():
        path = REPOSITORY / name
        path.write_text(set_version(path.read_text("utf-8"), pattern, version), "utf-8")
    changelog = REPOSITORY / "CHANGELOG.md"
    today = datetime.datetime.now(datetime.timezone.utc).date()
    changelog.write_text(date_changelog(changelog.read_text("utf-8"), version, today), "utf-8")
    run("git", "commit", "--quiet", "--all", "--message", f"Version {version}")
    try:
        run(sys.executable, "scripts/package/try_out.py", "--out", "dist")
        files = sorted(map(str, (REPOSITORY / "dist").glob(f"belief_scene_graphs-{version}*")))
        run(sys.executable, "-m", "twine", "check", "--strict", *files)
    except BaseException:  # also Ctrl-C
        run("git", "reset", "--quiet", "--hard", "HEAD~1")
        raise
    run("git", "tag", "--annotate", f"v{version}", "--message", f"Version {version}")
    print(f"\nv{version} is tagged, and its files are in dist. To publish them:")
    print(f"  git push origin main v{version} && python -m twine upload dist/*")
    print("To take it back:")
    print(f"  git tag --delete v{version} && git reset --hard HEAD~1")


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
    if tell("git", "rev-parse", "--abbrev-ref", "HEAD") != "main":
        raise click.ClickException("releases are made on main")
    if tell("git", "tag", "--list", f"v{version}"):
        raise click.ClickException(f"v{version} is tagged already; choose the next version")
    if "\n## Unreleased\n" not in (REPOSITORY / "CHANGELOG.md").read_text("utf-8"):
        raise click.ClickException("CHANGELOG.md has no part `## Unreleased`: nothing to release")


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


def run(*words: str) -> None:
    """Run a program in the checkout and show what it prints.

    Raises:
        ClickException: if it fails.
    """
    if subprocess.run(words, cwd=REPOSITORY).returncode:
        raise click.ClickException(f"{' '.join(words)} failed")


def tell(*words: str) -> str:
    """Return what a program prints."""
    done = subprocess.run(words, cwd=REPOSITORY, capture_output=True, text=True, check=True)
    return done.stdout.strip()


if __name__ == "__main__":
    main()
