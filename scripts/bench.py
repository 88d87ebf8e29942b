"""Time the main jobs of this checkout beside those of another: the same work, in one run.

    git worktree add ../before COMMIT
    python scripts/bench.py --base ../before [--hm3d PATH]

Each job is a command, run by each checkout in turn, in a folder of its own, with the same Python.
What is compared is processor time, the least of some runs. Without `--hm3d` the buildings are
synthetic.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from bsg_data.tables import format_text

REPOSITORY = Path(__file__).resolve().parents[1]
PACKAGES = {"bsg_cli": "cli", "bsg_mappings": "mappings", "bsg_weights": "weights"}
PACKAGES |= {"bsg_data": "bsg_data", "bsg_models": "bsg_models"}
NETWORK = "--set training.epochs=3 --set training.validate_every=3 --force"
JOBS = {
    "build": "bsg-data build --hm3d {hm3d} --out dataset --workers 1 --force",
    "split": "bsg-data split dataset --force",
    "pairs, 10 draws": "bsg-data pairs dataset --workers 1 --force",
    "check": "bsg-data check dataset",
    "training, ceci-gcn": f"bsg-train --config ceci-gcn --data dataset --out gcn {NETWORK}",
    "training, universal": f"bsg-train --config universal --data dataset --out sage {NETWORK}",
    "training, gamma-poisson": "bsg-train --config gamma-poisson --data dataset --out run --force",
    "evaluation": "bsg-evaluate run --data dataset --resamples 100 --out results --force",
    "a belief": "bsg-belief {home} --find microwave --model universal",
    "a search study": "bsg-search --data dataset --model run --worlds tree:1-10 --episodes 2 "
    "--masks 2 --resamples 10 --workers 1 --out found --force",
}


def link_packages(checkout: Path, folder: Path) -> Path:
    """Return a folder from which Python imports the packages of a checkout."""
    folder.mkdir(parents=True)
    for package, place in PACKAGES.items():
        (folder / package).symlink_to(checkout / place)
    return folder


def run(line: str, packages: Path, work: Path) -> float:
    """Run a command by the code of a checkout; return its seconds of processor time."""
    program, *words = line.split()
    module = program.removeprefix("bsg-")
    code = f"from bsg_cli.{module} import main; main()"
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(
        [sys.executable, "-c", code, *words],
        cwd=work,
        env={**os.environ, "PYTHONPATH": str(packages), "OMP_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode:
        sys.exit(f"{line}: {done.stderr.strip() or done.stdout.strip()}")
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main(argv: Sequence[str] | None = None) -> None:
    """Time the jobs and print a row for each."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--base", type=Path, required=True, help="the other checkout")
    parser.add_argument("--hm3d", type=Path, help="folder with annotations of HM3D")
    parser.add_argument("--runs", type=int, default=3, help="of each job; the least time counts")
    parser.add_argument("--jobs", nargs="+", choices=JOBS, default=list(JOBS), metavar="JOB")
    options = parser.parse_args(argv)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        checkouts = {"now": REPOSITORY, "before": options.base.resolve()}
        links = {who: link_packages(at, folder / "code" / who) for who, at in checkouts.items()}
        work = {who: folder / "work" / who for who in checkouts}
        for place in work.values():
            place.mkdir(parents=True)
        hm3d = options.hm3d.resolve() if options.hm3d else folder / "hm3d"
        if not options.hm3d:
            run(f"bsg-data synth --out {hm3d} --scenes 60 --workers 1", links["now"], folder)
        rows = []
        for job, line in JOBS.items():
            told = line.format(hm3d=hm3d, home=REPOSITORY / "docs" / "home.json")
            times = {who: [] for who in checkouts}  # type: dict[str, list[float]]
            for _ in range(options.runs if job in options.jobs else 1):  # later jobs need its files
                for who, seconds in times.items():
                    seconds.append(run(told, links[who], work[who]))
            now, before = min(times["now"]), min(times["before"])
            if job in options.jobs:
                rows.append((job, f"{now:.2f}", f"{before:.2f}", f"{now / before:.2f}"))
                print(*rows[-1], sep="\t", file=sys.stderr, flush=True)
    print(format_text(rows, header=("job", "now, s", "before, s", "now / before")))


if __name__ == "__main__":
    main()
