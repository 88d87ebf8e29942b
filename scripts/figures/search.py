"""Draw the replay of a search that README.md shows, by the commands that docs/search.md lists.

python scripts/figures/search.py --out docs/figures/search.png
"""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import click

PAGE = Path(__file__).resolve().parents[2] / "docs" / "search.md"
PICTURE = "search.png"


def read_commands() -> list[str]:
    """Return the commands of the block whose last line draws the picture."""
    blocks: list[str] = re.findall(
        r"^```sh\n(.*?)^```$", PAGE.read_text("utf-8"), re.DOTALL | re.MULTILINE
    )
    (block,) = (block for block in blocks if block.endswith(f"--animation {PICTURE}\n"))
    return block.splitlines()


@click.command(help=__doc__, context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--out", type=click.Path(path_type=Path), required=True, help="The picture, a PNG.")
def main(out: Path) -> None:
    """Run the commands in an empty folder and keep the picture."""
    programs = Path(sys.executable).parent
    with tempfile.TemporaryDirectory() as folder:
        for line in read_commands():
            name, *words = shlex.split(line)
            subprocess.run([programs / name, *words], cwd=folder, check=True)
        shutil.copyfile(Path(folder, PICTURE), out)


if __name__ == "__main__":
    main()
