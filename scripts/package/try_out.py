"""Build the wheel and the source archive, and try both in fresh environments.

    python scripts/package/try_out.py --out dist --python python3.12

Without extras, `bsg-data` and all that asks have to work, and every other command has to name the
extra that it needs; what an answer takes is measured (`ask.py`). With extras, the commands of
`make demo` have to run; this is tried on the wheel alone, for `build` makes the wheel from the
source archive. It prints the seconds and the size of each installation.

Both files get into the folder when both were tried. Files of other versions stay there.
"""

from __future__ import annotations

import hashlib
import os
import re
import resource
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import click

REPOSITORY = Path(__file__).resolve().parents[2]
NAME = "belief_scene_graphs"
ASKS = (
    "bsg-belief home.json --find microwave --from living",
    "bsg-belief home.json --find microwave --from living",
    "bsg-belief home.json --out home.html --out home.json",
    "bsg-models show universal",
)
NEED_MORE = (
    "bsg-train dataset --config mixture --out run",
    "bsg-evaluate dataset --model universal",
    "bsg-search dataset",
    "bsg-leaderboard dataset --out board",
    "bsg-models export universal --out universal.onnx",
)
ONE_THREAD = {"OMP_NUM_THREADS": "1", "MPLBACKEND": "agg"}


@click.command(help=__doc__, context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--out", type=click.Path(path_type=Path), required=True, help="Where files go.")
@click.option("--python", default=sys.executable, help="Python of the fresh environments.")
@click.option("--extras", default="train", show_default=True, help="Extras of the whole program.")
@click.option("--constraint", type=click.Path(path_type=Path), help="Versions, as pip takes them.")
def main(out: Path, python: str, extras: str, constraint: Path | None) -> None:
    """Build, install, run."""
    with tempfile.TemporaryDirectory() as name:
        paths = build(Path(name))
        for path in paths:
            try_file(path, python, extras, constraint)
            print(f"{path.name}: runs; sha256 {hashlib.sha256(path.read_bytes()).hexdigest()}")
        out.mkdir(parents=True, exist_ok=True)
        for path in paths:
            shutil.copy(path, out)


def build(folder: Path) -> list[Path]:
    """Build both files from what git has, so that nothing of this checkout gets into them."""
    source, out = folder / "source", folder / "built"
    run("git", "clone", "--quiet", "--depth", "1", f"file://{REPOSITORY}", str(source))
    run(sys.executable, "-m", "build", "--outdir", str(out), str(source))
    return sorted(out.glob(f"{NAME}-*"), reverse=True)


def try_file(path: Path, python: str, extras: str, constraint: Path | None) -> None:
    """Install a file into a fresh environment, without extras and, if a wheel, with them."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        environment = Environment(folder / "venv", python, constraint)
        environment.install(f"{path}")
        environment.try_asking(folder)
        environment.try_data(folder)
        if path.suffix == ".whl":
            environment.install(f"{path}[{extras}]")
            environment.try_demo(folder / "demo")


class Environment:
    """A fresh environment of Python."""

    def __init__(self, folder: Path, python: str, constraint: Path | None) -> None:
        run(python, "-m", "venv", str(folder))
        self._folder = folder
        self._constraint = (
            [] if constraint is None else ["--constraint", str(constraint.absolute())]
        )

    def install(self, requirement: str) -> None:
        """Install and say what that took."""
        begun = time.monotonic()
        pip = [self._program("python"), "-m", "pip", "install", "--quiet", *self._constraint]
        run(*pip, requirement)
        size = sum(path.stat().st_size for path in self._folder.rglob("*") if path.is_file())
        took = time.monotonic() - begun
        print(f"pip install {Path(requirement).name}: {took:.0f} s, {size / 1e6:,.0f} MB in all")

    def try_asking(self, folder: Path) -> None:
        """Ask by every way that needs no extra, and print what it took."""
        (folder / "home.json").write_bytes((REPOSITORY / "docs/home.json").read_bytes())
        for line in ASKS:
            before = measure_processor()
            self._run(line, folder)
            print(f"| `{line}`, processor | {measure_processor() - before:.2f} s |")
        print(self._run(f"python {REPOSITORY / 'scripts/package/ask.py'} home.json", folder).stdout)

    def try_data(self, folder: Path) -> None:
        """Run `bsg-data`, and have the other commands say what they lack."""
        for line in (
            "bsg-data synth --out buildings --scenes 5",
            "bsg-data build --hm3d buildings --out dataset",
            "bsg-data split dataset --ratios 0.6 0.2 0.2",
            "bsg-data pairs dataset --draws 2",
            "bsg-data check dataset",
        ):
            self._run(line, folder)
        for line in NEED_MORE:
            done = self._run(line, folder, fails=True)
            if "pip install '.[" not in done.stderr or "Traceback" in done.stderr:
                raise click.ClickException(f"{line}: does not say what it lacks:\n{done.stderr}")

    def try_demo(self, folder: Path) -> None:
        """Run the commands of `make demo`, and time the first belief page of a robot."""
        folder.mkdir()
        begun = time.monotonic()
        (folder / "home.json").write_bytes((REPOSITORY / "docs/home.json").read_bytes())
        self._run("bsg-belief home.json --out home.html", folder)
        print(f"first belief page: {time.monotonic() - begun:.0f} s after the installation")
        for line in demo_lines():
            self._run(line, folder)

    def _program(self, name: str) -> str:
        return str(self._folder / "bin" / name)

    def _run(
        self, line: str, folder: Path, *, fails: bool = False
    ) -> subprocess.CompletedProcess[str]:
        program, *words = shlex.split(line)
        environment = {k: v for k, v in os.environ.items() if not k.startswith("PYTHON")}
        done = subprocess.run(
            [self._program(program), *words],
            cwd=folder,
            env={**environment, **ONE_THREAD},
            capture_output=True,
            text=True,
        )
        if (done.returncode == 0) == fails:
            raise click.ClickException(f"{line}: exit code {done.returncode}\n{done.stderr}")
        return done


def measure_processor() -> float:
    """Return the seconds of processor that the programs took that were run so far."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def demo_lines() -> Iterator[str]:
    """Yield the commands of `make demo`, in the folder above its results."""
    makefile = (REPOSITORY / "Makefile").read_text("utf-8")
    recipe = makefile.split("\ndemo:")[1].split("\n\n")[0]
    for line in re.findall(r"^\t\$\(BIN\)/(bsg-.*)$", recipe, re.MULTILINE):
        yield line.replace("$(DEMO)", "demo")


def run(*words: str) -> None:
    """Run a program; it says itself what went wrong.

    Raises:
        ClickException: if it fails.
    """
    done = subprocess.run(words, capture_output=True, text=True)
    if done.returncode:
        raise click.ClickException(f"{' '.join(words)}\n{done.stdout}{done.stderr}")


if __name__ == "__main__":
    main()
