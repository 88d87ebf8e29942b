"""Measure what a mesh costs beside reading it: seconds and peak memory, with the ratios.

    python scripts/bench/mesh.py

Writes one full-size synthetic scene to a temporary folder and reads it in processes of their own:
`trimesh.load` as it is, which leaves the textures packed; the same with its textures unpacked; and
`survey_mesh`, which does both and measures every instance. `make bench` runs it, too.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import trimesh
from timing import Speed

from bsg_data.geometry.semantic_mesh import survey_mesh
from bsg_data.sources.annotations import parse_annotation
from bsg_data.synthetic.buildings import write_synthetic
from bsg_data.synthetic.geometry import GeometryOptions

REPEATS = 5
SCENE = 1  # of seed 0: 22 rooms, about 1,000 objects


def load(mesh: Path, _: list[str]) -> None:
    """Read the mesh; its textures stay packed."""
    trimesh.load_scene(mesh)


def load_and_unpack(mesh: Path, _: list[str]) -> None:
    """Read the mesh and its pixels."""
    for part in trimesh.load_scene(mesh).geometry.values():
        np.asarray(part.visual.material.baseColorTexture)


def survey(mesh: Path, colours: list[str]) -> None:
    """Measure every instance of the mesh."""
    survey_mesh(mesh, colours)


WAYS: dict[str, Callable[[Path, list[str]], None]] = {
    "trimesh.load": load,
    "trimesh.load, textures unpacked": load_and_unpack,
    "survey_mesh": survey,
}


def measure_way(way: str, annotation: Path) -> tuple[float, float]:
    """Return the least seconds of several calls, and the peak memory of the process, MiB."""
    mesh = annotation.with_suffix(".glb")
    colours = [
        str(one.colour) for one in parse_annotation(annotation.read_bytes(), path=annotation)
    ]
    WAYS[way](mesh, colours)
    peak = measure_peak()
    seconds = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        WAYS[way](mesh, colours)
        seconds.append(time.perf_counter() - start)
    return min(seconds), peak


def measure_peak() -> float:
    """Return the peak memory of this process, MiB.

    Linux counts what the parent held before this program was loaded in `ru_maxrss`, and not in its
    status file.
    """
    status = Path("/proc/self/status")
    if status.exists():
        (peak,) = (line for line in status.read_text().splitlines() if line.startswith("VmHWM"))
        return int(peak.split()[1]) / 2**10
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20


def measure_all() -> dict[str, tuple[float, float]]:
    """Return seconds and peak memory, MiB, of every way, each in a process of its own."""
    found = {}
    with tempfile.TemporaryDirectory() as folder:
        options = GeometryOptions(size="full")
        *_, annotation = write_synthetic(
            Path(folder, "full"), scenes=SCENE + 1, seed=0, geometry=options
        )
        for way in WAYS:
            command = [sys.executable, __file__, way, str(annotation)]
            done = subprocess.run(command, check=True, capture_output=True, text=True)
            seconds, peak = done.stdout.split()
            found[way] = (float(seconds), float(peak))
    return found


def measure() -> Iterator[Speed]:
    """Yield what a survey takes beside reading the mesh and its pixels."""
    found = measure_all()
    unpacked = "trimesh.load, textures unpacked"
    yield Speed(
        what="`survey_mesh` of a full-size scene",
        against=unpacked,
        ours_s=found["survey_mesh"][0],
        theirs_s=found[unpacked][0],
        target=2,
    )


def main() -> None:
    """Run every way in a process of its own and print the table."""
    if len(sys.argv) == 3:
        print(*measure_way(sys.argv[1], Path(sys.argv[2])))
        return
    found = measure_all()
    ours = found["survey_mesh"]
    print(f"{'':34s}seconds  peak MiB  survey_mesh is")
    for way, (seconds, peak) in found.items():
        ratios = f"{ours[0] / seconds:.1f} × its time, {ours[1] / peak:.2f} × its memory"
        print(f"{way:34s}{seconds:7.3f}  {peak:8.0f}  {ratios}")


if __name__ == "__main__":
    main()
