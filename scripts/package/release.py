"""Prepare a release: version, changelog, checks, files, tag. Nothing is uploaded.

    python scripts/package/release.py 0.2.0

The version and the changelog are committed to main, this commit is checked, built and tried, and
then tagged. If a step fails, the commit is taken back.
"""

from __future__ import annotations

import datetime
import re
import shlex
import subprocess
import sys
from pathlib import Path

import click

REPOSITORY = Path(__file__).resolve().parents[2]
PLACES = {"pyproject.toml": r'^version = "(.+)"$', "CITATION.cff": r"^version: (\S+)$"}


@click.command(help=__doc__, context_settings={"help_option_names": ["-h", "--help"]})
@click.argument("version")
def main(version: str) -> None:
    """Prepare the release of a version."""
    if re.fullmatch(r"\d+\.\d+\.\d+", version) is None:
        raise click.ClickException(f"{version}: expected a version like 0.2.0")
    if tell("git", "status", "--porcelain") or tell("git", "branch", "--show-current") != "main":
        raise click.ClickException("releases are made on main, without changes; commit them first")
    if tell("git", "tag", "--list", f"v{version}"):
        raise click.ClickException(f"v{version} is tagged already; choose the next version")
    for name, pattern in PLACES.items():
        path = REPOSITORY / name
        path.write_text(set_version(path.read_text("utf-8"), pattern, version), "utf-8")
    path = REPOSITORY / "CHANGELOG.md"
    today = datetime.datetime.now(datetime.timezone.utc).date()
    path.write_text(date_changelog(path.read_text("utf-8"), version, today), "utf-8")
    run("git", "commit", "--quiet", "--all", "--message", f"Version {version}")
    try:
        run("make", "all")
        run(sys.executable, "scripts/package/try_out.py", "--out", "dist")
        files = [str(path) for path in (REPOSITORY / "dist").glob(f"*-{version}*")]
        run(sys.executable, "-m", "twine", "check", "--strict", *files)
    except click.ClickException:
        run("git", "reset", "--quiet", "--keep", "HEAD~")
        raise
    run("git", "tag", "--annotate", f"v{version}", "--message", f"Version {version}")
    print(
        f"\nTo publish: git push origin main v{version} && python -m twine upload dist/*-{version}*"
    )
    print(f"To take it back: git tag --delete v{version} && git revert --no-edit HEAD")


def set_version(text: str, pattern: str, version: str) -> str:
    """Return a file with another version; its version has to stand there exactly once."""
    found = re.findall(pattern, text, re.MULTILINE)
    if len(found) != 1:
        raise click.ClickException(f"expected one line like {pattern}, found {len(found)}")
    return re.sub(pattern, lambda line: line[0].replace(found[0], version), text, flags=re.M)


def date_changelog(text: str, version: str, today: datetime.date) -> str:
    """Return the changelog with what was unreleased under a version and a date."""
    if "\n## Unreleased\n" not in text:
        raise click.ClickException("CHANGELOG.md has no part `## Unreleased`: nothing to release")
    return text.replace("## Unreleased", f"## {version} ({today.isoformat()})", 1)


def run(*words: str) -> None:
    """Run a program in the checkout and show what it prints."""
    if subprocess.run(words, cwd=REPOSITORY).returncode:
        raise click.ClickException(f"{shlex.join(words)} failed; nothing was released")


def tell(*words: str) -> str:
    """Return what a program prints."""
    done = subprocess.run(words, cwd=REPOSITORY, capture_output=True, text=True, check=True)
    return done.stdout.strip()


if __name__ == "__main__":
    main()
