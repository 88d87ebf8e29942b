"""Draw the replay of a search that README.md shows, by the commands of `make demo`.

python scripts/figures/search.py --out docs/figures/search.png
"""

from __future__ import annotations

import shlex
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import click

MAKEFILE = Path(__file__).resolve().parents[2] / "Makefile"
PICTURE = "search.png"
NEEDED = ("synth", "build", "split", "bsg-search")


def read_commands() -> list[str]:
    """Return the commands of `make demo` that the picture needs, for results in `demo`."""
    recipe = MAKEFILE.read_text("utf-8").split("\ndemo:")[1].split("\n\n")[0]
    lines = recipe.replace("$(BIN)/", "").replace("$(DEMO)", "demo").splitlines()[1:]
    found = (line.strip() for line in lines)
    return [line for line in found if set(NEEDED) & set(line.split()[:2])]


@click.command(help=__doc__, context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--out", type=click.Path(path_type=Path), required=True, help="The picture, a PNG.")
def main(out: Path) -> None:
    """Run the commands in an empty folder and keep the picture."""
    programs = Path(sys.executable).parent
    with tempfile.TemporaryDirectory() as folder:
        for line in read_commands():
            name, *words = shlex.split(line)
            subprocess.run([programs / name, *words], cwd=folder, check=True)
        shutil.copyfile(Path(folder, "demo", "search", PICTURE), out)


if __name__ == "__main__":
    main()
