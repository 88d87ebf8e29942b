"""Try a command under a fault, and compare what it leaves with what an unbroken run leaves."""

from __future__ import annotations

import hashlib
import json
import random
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import count, groupby
from pathlib import Path

from commands import Command, Given
from fork_server import Chance, Ended, ForkServer
from system_calls import EVERY, Call, Fault, Kind, can_watch
from tally import Tally

DATA_MODULES = ("bsg_cli.data", "bsg_data.build", "bsg_data.observation.pairs", "bsg_data.merge")
MODEL_MODULES = (
    *(f"bsg_cli.{name}" for name in ("train", "evaluate", "leaderboard", "search", "belief")),
    *("bsg_cli.data", "bsg_models.training.training", "bsg_models.studies.search_study"),
    *("matplotlib.pyplot", "torch_geometric", "bsg_models.evaluation.rank_sweep"),
)
Tree = Mapping[str, str]  # path below a folder → sha256; of a folder, "" under its path and "/"


@dataclass(frozen=True, slots=True)
class Unbroken:
    """What a run without a fault does: the files before and after it, and its calls."""

    before: Tree
    after: Tree
    calls: tuple[Call, ...]

    def points(self, kinds: Sequence[Kind], *, most: int | None = None, seed: int = 0) -> list[int]:
        """Return numbers of the calls of these kinds to be struck, from 1.

        Of calls that follow one another and are the same, as the blocks of one file, the first,
        the middle and the last are struck.

        Args:
            kinds: those that count.
            most: a random sample of so many.
            seed: of the sample.
        """
        numbered = enumerate((call for call in self.calls if call.kind in kinds), 1)
        points: list[int] = []
        for _, group in groupby(numbered, key=lambda one: one[1]):
            numbers = [number for number, _ in group]
            points += sorted({numbers[0], numbers[len(numbers) // 2], numbers[-1]})
        if most is not None and most < len(points):
            points = sorted(random.Random(seed).sample(points, most))
        return points


class Bench:
    """Where commands are tried: what they are given, and who runs them."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._numbers = count()
        self._servers: dict[bool, ForkServer] = {}
        self._random: ForkServer | None = None
        self._warm_at_random: set[str] = set()
        self._given = Given(self.server_of, folder / "given")
        self._unbroken: dict[str, Unbroken] = {}

    def close(self) -> None:
        """End the processes."""
        for server in self._servers.values():
            server.close()
        if self._random is not None:
            self._random.close()

    @staticmethod
    def is_heavy(words: Sequence[str]) -> bool:
        """Say whether a command imports torch or matplotlib."""
        return words[0] != "bsg-data" or "--figure" in words

    def server_of(self, command: Sequence[str]) -> ForkServer:
        """Return who runs a command: one with torch and matplotlib, or a lighter one."""
        heavy = self.is_heavy(command)
        if heavy not in self._servers:
            self._servers[heavy] = ForkServer(MODEL_MODULES if heavy else DATA_MODULES)
        return self._servers[heavy]

    def random_server(self) -> ForkServer:
        """Return who runs commands of `bsg-data` whose calls fail at random."""
        if self._random is None:
            self._random = ForkServer(DATA_MODULES, under=("fiu-run", "-x", "-f", ""))
        return self._random

    def lay_out(self, command: Command, folder: Path | None = None) -> Path:
        """Return a new folder with what a command is given."""
        folder = self._folder / f"case-{next(self._numbers)}" if folder is None else folder
        self._given.lay_out(command, folder)
        return folder

    def run(self, words: Sequence[str], folder: Path, fault: Fault | None = None) -> Ended:
        """Run a command in a folder."""
        return self.server_of(words).run(words, folder, fault)

    def warm(self, command: Command) -> None:
        """Have everything imported that a command imports."""
        folder = self.lay_out(command)
        assert self.run(command.words, folder).code == 0
        shutil.rmtree(folder)

    def unbroken(self, command: Command) -> Unbroken:
        """Return what a command does where nothing goes wrong."""
        if command.name not in self._unbroken:
            folder = self.lay_out(command)
            before = read_tree(folder)
            ended = self.run(command.words, folder, Fault(kinds=EVERY) if not can_watch() else None)
            assert ended.code == 0, ended.said
            self.follow(command, folder)
            self._unbroken[command.name] = Unbroken(before, read_tree(folder), ended.calls)
            shutil.rmtree(folder)
        return self._unbroken[command.name]

    def follow(self, command: Command, folder: Path) -> Ended | None:
        """Run what follows a command that is through."""
        return self.run(command.then.split(), folder) if command.then else None

    def strike(self, command: Command, fault: Fault | None, *, memory: int | None = None) -> Trial:
        """Run a command under a fault in a folder of its own, and judge what it leaves."""
        return self.try_in(self.lay_out(command), command, fault, memory=memory)

    def try_in(
        self,
        folder: Path,
        command: Command,
        fault: Fault | None = None,
        *,
        memory: int | None = None,
    ) -> Trial:
        """Run a command under a fault in a folder, and judge what it leaves."""
        whole = self.unbroken(command)
        ended = self.server_of(command.words).run(command.words, folder, fault, memory=memory)
        return Trial(self, command, whole, folder, ended, fault)

    def strike_at_random(self, command: Command, chance: Chance) -> Trial:
        """Run a command whose calls fail at random in a folder of its own."""
        folder = self.lay_out(command)
        whole = self.unbroken(command)
        server = self.random_server()
        if command.name not in self._warm_at_random:  # imports are not ours: they fail as they like
            server.run(command.words, self.lay_out(command))
            self._warm_at_random.add(command.name)
        ended = server.run(command.words, folder, chance=chance)
        trial = Trial(self, command, whole, folder, ended, None)
        trial.title = f"{command.name}, {chance.probability} of the calls fail, {chance.seed}"
        return trial

    def note(
        self, tally: Tally, test: str, command: Command, tried: int, misses: Sequence[str]
    ) -> None:
        """Tell the tally of trials, whose misses each begin with what was tried and a colon."""
        survived = tried - len({miss.partition(": ")[0] for miss in misses})
        program = command.words[0]
        tally(
            test=test,
            command=f"{program}, {command.name}",
            tried=tried,
            survived=survived,
            misses=misses,
        )


_WHOLE = ("/dataset.json", "/SHA256SUMS")  # written last


class Trial:
    """A command that met a fault: what it left, what is wrong with it, and how it goes on."""

    def __init__(
        self,
        bench: Bench,
        command: Command,
        whole: Unbroken,
        folder: Path,
        ended: Ended,
        fault: Fault | None,
    ) -> None:
        self.bench, self.command, self.whole, self.folder = bench, command, whole, folder
        self.ended, self.fault = ended, fault
        self.now = read_tree(folder)
        self.title = command.name
        if fault is not None:
            lasting = " and on" if fault.lasting else ""
            call = f" ({self.struck})" if self.struck else ""
            self.title += f", {fault.deed} at call {fault.at}{lasting}{call}"
        self.wrong = find_half_written(command, whole, self.now) + find_unlisted(folder)
        self.wrong += find_traceback(ended.said) + find_unsealed(folder, self.now)
        if ended.code is None:
            self.wrong.append("it hangs")
        if ended.code == 0 and not command.then:
            after, now = self._without_work(whole.after), self._without_work(self.now)
            self.wrong += compare(command, after, now)

    def find_left(self) -> None:
        """Find fault with files that are neither all those of before nor all those of after.

        Work that is not done is left where its removal is what failed: the next run removes it.
        Work that is whole and could not be put in its place waits there: the next run puts it.
        """
        before, after = (
            compare(self.command, self._without_work(wanted), self._without_work(self.now))
            for wanted in (self.whole.before, self.whole.after)
        )
        if before and after:
            self.wrong += [f"stopped, {fault}" for fault in before]

    def _without_work(self, tree: Tree) -> Tree:
        struck = self.struck
        if struck is None:
            return tree
        waits = any(path.endswith(_WHOLE) and is_unfinished(path) for path in self.now)
        removes = struck.kind == "remove" or (struck.kind == "open" and is_unfinished(struck.path))
        if not (waits or removes):
            return tree
        empty = f"{struck.path}/"  # a folder that could not be removed
        return {
            path: digest
            for path, digest in tree.items()
            if not is_unfinished(path) and path != empty
        }

    @property
    def struck(self) -> Call | None:
        """The call that the fault came at."""
        if self.fault is None or not 0 < self.fault.at <= len(self.ended.calls):
            return None
        return self.ended.calls[self.fault.at - 1]

    def find_no_error(self) -> None:
        """Find fault with an exit code other than 1, and with a failure that is not explained.

        A library in C++ that ends the process by a signal has as good as killed it.
        """
        code = self.ended.code
        if code is not None and code > 1:
            self.wrong.append(f"exit code {code}")
        if code == 1 and "Error: " not in self.ended.said:
            self.wrong.append(f"no error is told, but {self.ended.said!r}")

    def finish(self) -> list[str]:
        """Run the command again, without a fault; return all that is wrong, and what was tried."""
        again = self.bench.run(self.command.words_again, self.folder)
        if again.code == 0:
            again = self.bench.follow(self.command, self.folder) or again
        end = read_tree(self.folder)
        differing = compare(self.command, self.whole.after, end) + find_unsealed(self.folder, end)
        self.wrong += find_traceback(again.said)
        if again.code is None:
            self.wrong.append("again it hangs")
        elif again.code != 0 and differing:
            self.wrong.append(f"again it says {again.said.strip()!r}")
        shutil.rmtree(self.folder)
        return [f"{self.title}: {fault}" for fault in (*self.wrong, *differing)]


def read_tree(folder: Path) -> Tree:
    """Return the hashes of all that lies in a folder."""
    return {
        path.relative_to(folder).as_posix() + "/" * path.is_dir(): (
            "" if path.is_dir() else hashlib.sha256(path.read_bytes()).hexdigest()
        )
        for path in folder.rglob("*")
    }


def is_unfinished(path: str) -> bool:
    """Say whether a path is of work that is not done: hidden, or `.partial`, at any depth."""
    return any(part.startswith(".") or part.endswith(".partial") for part in path.split("/"))


def is_varying(command: Command, path: str) -> bool:
    """Say whether the bytes of a file differ between two unbroken runs."""
    return path.endswith(command.varying or ("\0",))


def find_half_written(command: Command, whole: Unbroken, now: Tree) -> list[str]:
    """Return what is visible and neither what was there before nor what is there in the end."""
    return [
        f"{path} is neither the old nor the new"
        for path, digest in now.items()
        if not is_unfinished(path)
        and not path.startswith(command.growing or ("\0",))
        and not path.endswith("/")
        and digest not in (whole.before.get(path), whole.after.get(path))
        and not is_varying(command, path)
    ]


def find_unlisted(folder: Path) -> list[str]:
    """Return the files that the manifest of a dataset lists and that are not what it says."""
    faults = []
    visible = [path for path in folder.iterdir() if not is_unfinished(path.name)]
    for manifest in [path / "dataset.json" for path in visible]:
        if not manifest.is_file():
            continue
        for entry in json.loads(manifest.read_text("utf-8"))["files"]:
            path = manifest.parent / entry["path"]
            if not path.is_file():
                faults.append(f"{path.relative_to(folder)} is listed and is not there")
            elif hashlib.sha256(path.read_bytes()).hexdigest() != entry["sha256"]:
                faults.append(f"{path.relative_to(folder)} has another hash than is listed")
    return faults


def find_unsealed(folder: Path, now: Tree) -> list[str]:
    """Return the files that a seal lists and that are not what it says."""
    faults = []
    for seal in [path for path in now if path.endswith("/SHA256SUMS") and not is_unfinished(path)]:
        for line in (folder / seal).read_text("utf-8").splitlines():
            digest, _, name = line.partition("  ")
            path = f"{seal.removesuffix('SHA256SUMS')}{name}"
            if now.get(path) != digest:
                faults.append(f"{path} is not what {seal} says")
    return faults


def compare(command: Command, wanted: Tree, now: Tree) -> list[str]:
    """Return how files differ from those that are wanted; a lock that nobody holds is nothing."""
    faults = []
    for path in sorted({*wanted, *now}):
        if path not in now:
            faults.append(f"{path} is missing")
        elif path not in wanted and not _is_free_lock(path, now[path]):
            faults.append(f"{path} is left")
        elif wanted.get(path, now[path]) != now[path] and not is_varying(command, path):
            faults.append(f"{path} has other bytes")
    return faults


def _is_free_lock(path: str, digest: str) -> bool:
    return path.endswith(".lock") and digest == hashlib.sha256(b"").hexdigest()


def find_traceback(said: str) -> list[str]:
    """Return a complaint if a command ended in a traceback."""
    lines = [line for line in said.splitlines() if line.strip()]
    return [f"a traceback: {lines[-1]}"] if "Traceback (most recent call last)" in said else []
