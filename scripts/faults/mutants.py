"""Change single things in the code that decides, and see whether its tests notice.

    python scripts/faults/mutants.py --sample 60 --seed 0 --tally build/faults.jsonl

mutmut makes the mutants and runs, for each, the tests that call its function. It works in a copy
below `build/mutants/`, one a room; the repository's files are only read. A run that was stopped
goes on where it was, as long as no file has changed since.

What is not mutated: the words of messages and other prose, which no test should repeat; zip's
`strict`; types; and decorated functions, which mutmut passes over. numba's decorator is taken off
in the copy, so that compiled functions are mutated, too. `explained_mutants.toml` lists mutants
that do the same as the code, each with the reason; they are not tried.
"""

from __future__ import annotations

import argparse
import ast
import difflib
import hashlib
import importlib
import json
import os
import random
import shutil
import subprocess
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path, PurePosixPath
from typing import Any, NamedTuple

REPOSITORY = Path(__file__).resolve().parent.parent.parent
EXPLAINED = Path(__file__).with_name("explained_mutants.toml")
COMPILED = "@compiled()"
KILLED = {1, 3, 24, 36, 152, 255, -24, -11, -9}  # tests failed, time was up, or Python died
COPIED = ("cli", "docs", "mappings", "scripts", "weights", "CHANGELOG.md", "Makefile", "README.md")


class Room(NamedTuple):
    """Files that decide one kind of thing.

    Attributes:
        files: patterns below the repository.
        choose: which of their tests are run, as pytest's `-k` has it; those left out take minutes
            where nothing is compiled, and others call the same functions.
    """

    files: tuple[str, ...]
    choose: str = ""


ROOMS = {
    "masks": Room(
        tuple(
            f"bsg_data/observation/{name}.py"
            for name in ("masks", "hiding", "explored_rooms", "masked_buildings")
        )
    ),
    "splits": Room(("bsg_data/dataset/splits.py",)),
    "check": Room(("bsg_data/checks/*.py",)),
    "counts": Room(
        tuple(
            f"bsg_models/belief/{name}.py"
            for name in ("count_distribution", "negative_binomial", "thinning")
        )
    ),
    "planners": Room(
        tuple(
            f"bsg_models/search/{name}.py"
            for name in ("planners", "orders", "exact_orders", "order_moves", "order_walks")
        ),
        choose="not many_rooms",
    ),
}


class Mutant(NamedTuple):
    """One changed place.

    Attributes:
        name: what mutmut calls it.
        file: below the repository.
        line: number of the first changed line.
        before: the lines that it changes, stripped.
        after: the lines that stand there instead.
    """

    name: str
    file: str
    line: int
    before: str
    after: str

    def __str__(self) -> str:
        """Return the place and the change in one line."""
        before, after = (" ".join(text.splitlines()) for text in (self.before, self.after))
        return f"{self.file}:{self.line}: `{before}` became `{after}`"


def list_files(room: Room) -> tuple[str, ...]:
    """Return the files of a room, below the repository."""
    found = (path for pattern in room.files for path in sorted(REPOSITORY.glob(pattern)))
    return tuple(
        path.relative_to(REPOSITORY).as_posix() for path in found if path.name != "__init__.py"
    )


def list_tests(files: Iterable[str]) -> tuple[str, ...]:
    """Return the test files that prove some source files, as `tests/test_mirror.py` knows them."""
    elsewhere: dict[str, str] = {}
    tree = ast.parse((REPOSITORY / "tests" / "test_mirror.py").read_text("utf-8"))
    for node in tree.body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "PROVED_ELSEWHERE":
            elsewhere = ast.literal_eval(node.value)
    own = (PurePosixPath(file) for file in files)
    mirrors = (elsewhere.get(str(file), f"{file.parent}/test_{file.name}") for file in own)
    return tuple(sorted({f"tests/{mirror}" for mirror in mirrors}))


def copy_tree(room: Room, folder: Path) -> None:
    """Copy the repository into a folder; leave a copy of the same bytes, with its results."""
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=REPOSITORY,
        check=True,
        capture_output=True,
        text=True,
    )
    names = [name for name in sorted(listed.stdout.split("\0")) if (REPOSITORY / name).is_file()]
    summed = hashlib.sha256()
    for name in names:
        if name.startswith("scripts/faults/"):
            continue  # no test of a room reads them
        summed.update(f"{name}\0".encode() + (REPOSITORY / name).read_bytes())
    told = folder / "copied.txt"
    if told.is_file() and told.read_text() == summed.hexdigest():
        return
    shutil.rmtree(folder, ignore_errors=True)
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(REPOSITORY / name, folder / name)
    files = list_files(room)
    for file in files:
        text = (folder / file).read_text("utf-8")
        (folder / file).write_text(text.replace(COMPILED, ""), "utf-8")
    with (folder / "pyproject.toml").open("a", encoding="utf-8") as project:
        project.write(configure(files, room.choose))
    told.write_text(summed.hexdigest())


def configure(files: Sequence[str], choose: str) -> str:
    """Return mutmut's table for some files."""
    lists: dict[str, Sequence[str]] = {
        "source_paths": ("bsg_data", "bsg_models"),
        "only_mutate": files,
        "also_copy": COPIED,
        "pytest_add_cli_args_test_selection": list_tests(files),
        "pytest_add_cli_args": ("-p", "no:cacheprovider", *(["-k", choose] if choose else [])),
    }
    lines = [f"{name} = {json.dumps(list(items))}" for name, items in lists.items()]
    return "\n".join(["\n[tool.mutmut]", "use_git_change_detection = false", *lines, ""])


def list_mutants(file: str, text: str) -> Iterator[Mutant]:
    """Yield the mutants of a file that change more than words."""
    # Imported here: reading the explained mutants, which a test does, needs no mutmut.
    from mutmut.mutation.file_mutation import mutate_file_contents

    made = mutate_file_contents(file, text)
    lines, places = made.code.splitlines(), _place_functions(text)
    spans = made.line_span_by_function_name
    for name in made.mutant_names:
        function = name.partition("__mutmut_")[0]
        original, mutant = (
            _cut_function(lines[span.start - 1 : span.end])
            for span in (spans[f"{function}__mutmut_orig"], spans[name])
        )
        first, before, after = _compare(original, mutant)
        if _decide("\n".join(original)) == _decide("\n".join(mutant)):
            continue
        module = file.removesuffix(".py").replace("/", ".")
        yield Mutant(f"{module}.{name}", file, places[function] + first, before, after)


def _place_functions(text: str) -> dict[str, int]:
    """Return the line of each function, by mutmut's name for it."""
    places = {}
    for node in ast.parse(text).body:
        if isinstance(node, ast.FunctionDef):
            places[f"x_{node.name}"] = node.lineno
        elif isinstance(node, ast.ClassDef):
            methods = (one for one in node.body if isinstance(one, ast.FunctionDef))
            places |= {f"xǁ{node.name}ǁ{method.name}": method.lineno for method in methods}
    return places


def _cut_function(lines: Sequence[str]) -> list[str]:
    """Return the lines of a function from its `def` on, without the indent of a method."""
    start = next(k for k, line in enumerate(lines) if line.lstrip().startswith("def "))
    indent = len(lines[start]) - len(lines[start].lstrip())
    return [line[indent:] for line in lines[start:]]


def _compare(original: Sequence[str], mutant: Sequence[str]) -> tuple[int, str, str]:
    """Return where two functions begin to differ, and the lines of each that differ.

    Their first lines hold their names, which mutmut made differ.
    """
    matcher = difflib.SequenceMatcher(None, original[1:], mutant[1:], autojunk=False)
    blocks = [block for block in matcher.get_opcodes() if block[0] != "equal"]
    if not blocks:  # a default in the first line
        names = (line.partition("(")[2].strip() for line in (original[0], mutant[0]))
        return 0, *names
    _, low, _, start, _ = blocks[0]
    _, _, high, _, end = blocks[-1]
    before, after = original[low + 1 : high + 1], mutant[start + 1 : end + 1]
    return low + 1, *("\n".join(line.strip() for line in part) for part in (before, after))


class _Wordless(ast.NodeTransformer):
    """Blank what is only said (prose, what an error is raised with, a fault) and zip's guard."""

    def visit_Raise(self, node: ast.Raise) -> ast.AST:
        if isinstance(node.exc, ast.Call):
            node.exc.args = []
        return self.generic_visit(node)

    def visit_Call(self, node: ast.Call) -> ast.AST:
        if isinstance(node.func, ast.Name) and node.func.id == "Fault":
            node.args = []
        if isinstance(node.func, ast.Name) and node.func.id == "zip":
            node.keywords = []  # `strict` guards what cannot happen
        return self.generic_visit(node)

    def visit_Constant(self, node: ast.Constant) -> ast.AST:
        if isinstance(node.value, str) and " " in node.value:
            node.value = ""
        return node

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        node.name = ""
        return self.generic_visit(node)


def _decide(function: str) -> str:
    """Return what a function does, without its name and its words."""
    return ast.dump(_Wordless().visit(ast.parse(function)))


def read_explained(path: Path = EXPLAINED) -> list[dict[str, str]]:
    """Return the mutants that do the same as the code: file, before, after and reason of each."""
    # Python 3.10 has no reader of TOML; tomli is the one that later Pythons took over.
    tomllib: Any = importlib.import_module("tomllib" if sys.version_info >= (3, 11) else "tomli")
    found: list[dict[str, str]] = tomllib.loads(path.read_text("utf-8")).get("mutant", [])
    return found


def run_mutants(folder: Path, chosen: Sequence[Mutant]) -> None:
    """Run the tests on those mutants that have no result yet."""
    known = read_results(folder, chosen)
    names = [mutant.name for mutant in chosen if mutant.name not in known]
    if not names:
        return
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "HYPOTHESIS_STORAGE_DIRECTORY": "database"}
    command = [str(Path(sys.executable).with_name("mutmut")), "run", "--max-children", "1"]
    done = subprocess.run([*command, *names], cwd=folder, env=environment, check=False)
    left = len(chosen) - len(read_results(folder, chosen))
    if left:
        sys.exit(f"mutmut ended with {done.returncode} and left {left} mutants; run this again")


def read_results(folder: Path, chosen: Iterable[Mutant]) -> Mapping[str, bool]:
    """Return of the mutants that were tried, by name, whether a test noticed them."""
    noticed: dict[str, bool] = {}
    for file in {mutant.file for mutant in chosen}:
        path = folder / "mutants" / f"{file}.meta"
        if path.is_file():
            codes = json.loads(path.read_text("utf-8"))["exit_code_by_key"]
            noticed |= {name: code in KILLED for name, code in codes.items() if code is not None}
    names = {mutant.name for mutant in chosen}
    return {name: killed for name, killed in noticed.items() if name in names}


def try_room(name: str, folder: Path, *, sample: int, seed: int) -> dict[str, Any]:
    """Try some mutants of a room, and return the line of the tally."""
    copy_tree(ROOMS[name], folder)
    os.chdir(folder)  # mutmut reads its settings from where it is
    explained = {(one["file"], one["before"], one["after"]) for one in read_explained()}
    files = list_files(ROOMS[name])
    found = [
        one for file in files for one in list_mutants(file, (folder / file).read_text("utf-8"))
    ]
    mutants = [one for one in found if (one.file, one.before, one.after) not in explained]
    chosen = random.Random(f"{seed} {name}").sample(mutants, min(sample, len(mutants)))
    print(
        f"{name}: {len(found)} mutants, {len(found) - len(mutants)} explained, "
        f"{len(chosen)} are tried",
        flush=True,
    )
    run_mutants(folder, chosen)
    noticed = read_results(folder, chosen)
    living = sorted(str(one) for one in chosen if not noticed[one.name])
    print(*living, f"{name}: {len(chosen) - len(living)} of {len(chosen)} killed", sep="\n")
    return {
        "test": "mutants",
        "command": name,
        "tried": len(chosen),
        "survived": len(chosen) - len(living),
        "misses": living,
    }


def main(argv: Sequence[str] | None = None) -> int:
    """Try the mutants of some rooms, and note what the tests did not see."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sample", type=int, default=60, help="mutants of each room")
    parser.add_argument("--seed", type=int, default=0, help="of the sample")
    parser.add_argument("--tally", type=Path, help="file to append what was tried to")
    parser.add_argument("--room", choices=ROOMS, action="append", help="all of them by default")
    parser.add_argument("--work", type=Path, default=REPOSITORY / "build" / "mutants")
    options = parser.parse_args(argv)
    tally = options.tally and options.tally.absolute()
    for name in options.room or ROOMS:
        folder = options.work.absolute() / name
        trial = try_room(name, folder, sample=options.sample, seed=options.seed)
        if tally is not None:
            with tally.open("a", encoding="utf-8") as lines:
                lines.write(json.dumps(trial) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
