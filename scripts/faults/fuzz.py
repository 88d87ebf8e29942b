"""Feed every reader with millions of inputs, led by which lines they reach: atheris.

    python scripts/faults/fuzz.py --minutes 60 --jobs 2

A reader is a target of tests/faults/fuzz, and runs in a process of its own, which is started again
when it hangs, eats memory or dies. What a reader must not do is kept as an input of
DIR/findings/READER with its traceback, one of each cause, and does not stop it. Inputs that reached
something new are kept in DIR/corpus/READER, with which a later run goes on. An input that failed
belongs into tests/faults/fuzz/corpus/READER, where the tests replay it.

The exit status is 1 if anything was found.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import mmap
import os
import random
import signal
import struct
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

REPOSITORY = Path(__file__).resolve().parent.parent.parent
sys.path.insert(
    0, str(REPOSITORY / "tests" / "faults")
)  # before this folder: it has a fuzz.py, too

from fuzz.catalogue import ROWS, find_target  # noqa: E402

if TYPE_CHECKING:
    from fuzz.target import Finding

SECONDS = 5  # that an input may take
MEGABYTES = 2_048  # that a reader may hold, with torch and all
_COUNTS = struct.Struct("<QQ")  # inputs, and those of them that failed
_KINDS = {
    "timeout": f"takes over {SECONDS} s",
    "oom": f"takes over {MEGABYTES} MB",
    "crash": "dies",
}


@dataclass
class Campaign:
    """What was done to one reader.

    Attributes:
        name: of the reader.
        folder: where inputs and findings are kept.
        tried: inputs in this run.
        failed: those of them that the reader neither read nor refused.
        causes: a line of each cause, those of earlier runs left out.
        seconds: that it took.
    """

    name: str
    folder: Path
    tried: int = 0
    failed: int = 0
    causes: list[str] = field(default_factory=list)
    seconds: float = 0.0

    @property
    def corpus(self) -> Path:
        """Inputs that reached something new."""
        return self.folder / "corpus" / self.name

    @property
    def findings(self) -> Path:
        """Inputs that failed, each with its cause beside it as .txt."""
        return self.folder / "findings" / self.name

    def kept(self) -> list[Path]:
        """Return the inputs that failed."""
        return [path for path in sorted(self.findings.iterdir()) if path.suffix != ".txt"]

    @property
    def counts(self) -> Path:
        """The counts of the process that runs, which outlive it however it ends."""
        return self.folder / f"{self.name}.counts"

    @property
    def log(self) -> Path:
        """What libFuzzer says."""
        return self.folder / f"{self.name}.log"


def run_reader(campaign: Campaign, *, seconds: float, runs: int, stop: threading.Event) -> Campaign:
    """Feed a reader until its time is over, it has had its inputs, or all is stopped."""
    for folder in (campaign.corpus, campaign.findings):
        folder.mkdir(parents=True, exist_ok=True)
    for path in campaign.kept():  # of an earlier run, and mended since
        if not fails(campaign.name, path):
            _forget(path)
    campaign.log.write_bytes(b"")
    begun, idle = time.monotonic(), 0
    while idle < 3 and not stop.is_set():
        left = seconds - (time.monotonic() - begun)
        if left < 1 or (runs and campaign.tried >= runs):
            break
        tried = _run_once(campaign, seconds=left, runs=runs, stop=stop)
        idle = 0 if tried else idle + 1  # times in a row that it ended before its first input
    if idle:
        campaign.causes.append(f"did not start; {campaign.log} says why")
    campaign.seconds = time.monotonic() - begun
    for path in campaign.kept():
        campaign.causes += _name_cause(path, campaign)
    return campaign


def _run_once(campaign: Campaign, *, seconds: float, runs: int, stop: threading.Event) -> int:
    """Run a process until it ends, and return how many inputs it read."""
    campaign.counts.write_bytes(bytes(_COUNTS.size))
    memory = "/dev/shm" if os.access("/dev/shm", os.W_OK) else None
    with tempfile.TemporaryDirectory(prefix="fuzz", dir=memory) as scratch:
        command = [sys.executable, __file__, "--child", campaign.name, "--memory", scratch]
        command += ["--corpus", str(campaign.folder), "--seconds", str(int(seconds))]
        command += ["--runs", str(runs - campaign.tried if runs else 0)]
        with campaign.log.open("ab") as log:
            # A session of its own: Ctrl-C ends it by way of this process, which then counts.
            child = subprocess.Popen(command, stdout=log, stderr=log, start_new_session=True)
            late = time.monotonic() + seconds + 120  # libFuzzer ends by itself before that
            while child.poll() is None and time.monotonic() < late and not stop.is_set():
                with contextlib.suppress(subprocess.TimeoutExpired):
                    child.wait(0.5)
            _end(child)
    tried, failed = _COUNTS.unpack(campaign.counts.read_bytes())
    campaign.counts.unlink()
    campaign.tried += tried
    campaign.failed += failed
    return int(tried)


def _end(child: subprocess.Popen[bytes]) -> None:
    if child.poll() is None:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(child.pid, signal.SIGKILL)
        child.wait()


def _name_cause(path: Path, campaign: Campaign) -> Iterator[str]:
    """Yield the cause of an input that failed; one that does not when it is alone is forgotten."""
    said = _beside(path)
    if said.is_file():  # an exception, noted by the process itself
        yield f"{said.read_text('utf-8').splitlines()[0]} ({path.name})"
        return
    kind = path.name.split("-")[0]
    if kind in _KINDS and fails(campaign.name, path):
        campaign.failed += 1
        yield f"{_KINDS[kind]} ({path.name})"
    else:
        _forget(path)  # a busy machine, or what earlier inputs had left in memory


def _beside(path: Path) -> Path:
    return path.with_name(f"{path.name}.txt")


def _forget(path: Path) -> None:
    path.unlink()
    _beside(path).unlink(missing_ok=True)


def fails(name: str, path: Path) -> bool:
    """Read an input in a process of its own, and say whether it fails."""
    command = [sys.executable, __file__, "--child", name, "--replay", str(path)]
    try:
        done = subprocess.run(command, capture_output=True, timeout=300)
    except subprocess.TimeoutExpired:
        return True
    return done.returncode != 0


def run_child(name: str, *, folder: Path, memory: Path, seconds: int, runs: int) -> None:
    """Feed a reader in this process; libFuzzer ends it."""
    import atheris

    with atheris.instrument_imports(include=["bsg_data", "bsg_models"]):
        from fuzz.mutation import change
        from fuzz.target import Bench

        target = find_target(name)
        bench = Bench(target, memory=memory).__enter__()  # and imports all that it needs
    campaign = Campaign(name, folder)
    for number, data in enumerate((*target.seeds().values(), *target.kept().values())):
        (campaign.corpus / f"seed-{number}").write_bytes(data)
    known: set[str] = set()
    words = [word.encode("utf-8", "surrogatepass") for word in target.words]
    with campaign.counts.open("r+b") as file:
        counts = mmap.mmap(file.fileno(), _COUNTS.size)
    tried = failed = 0

    def try_input(data: bytes) -> None:
        nonlocal tried, failed
        tried += 1
        _COUNTS.pack_into(counts, 0, tried, failed)
        finding = bench.try_input(data)
        if finding is not None:
            failed += 1
            _COUNTS.pack_into(counts, 0, tried, failed)
            if finding.key not in known:
                known.add(finding.key)
                _keep(campaign.findings, data, finding)

    def mutate(data: bytes, most: int, seed: int) -> bytes:
        if seed % 3:  # values and words where libFuzzer, which knows neither, flips bytes
            return change(data, random.Random(seed), words=words, most=most)
        return bytes(atheris.Mutate(data, most))

    arguments = [
        *(sys.argv[0], f"-max_total_time={seconds}", f"-timeout={SECONDS}", "-report_slow_units=4"),
        *(f"-rss_limit_mb={MEGABYTES}", f"-max_len={target.longest}"),
        *(f"-artifact_prefix={campaign.findings}/", "-reload=0", "-print_final_stats=1"),
        *([f"-runs={runs}"] if runs else []),
        str(campaign.corpus),
    ]
    atheris.Setup(arguments, try_input, custom_mutator=mutate)
    atheris.Fuzz()


def _keep(findings: Path, data: bytes, finding: Finding) -> None:
    """Keep an input, one of each cause; what was found before stays."""
    name = "finding-" + hashlib.sha256(finding.key.encode()).hexdigest()[:12]
    if not (findings / name).exists():
        (findings / f"{name}.txt").write_text(f"{finding.key}\n{finding.text}\n", "utf-8")
        (findings / name).write_bytes(data)


def replay(name: str, path: Path) -> int:
    """Read one input in this process, within the limits, and return 1 if it fails."""
    import resource

    from fuzz.target import Bench

    with Bench(find_target(name)) as bench:
        data = path.read_bytes()
        used = resource.getrusage(resource.RUSAGE_SELF)
        spent = int(used.ru_utime + used.ru_stime)
        resource.setrlimit(resource.RLIMIT_CPU, (spent + SECONDS + 1, spent + SECONDS + 2))
        finding = bench.try_input(data)
        held = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
    if finding is not None:
        print(finding.text, file=sys.stderr)
    return int(finding is not None or held > MEGABYTES)


def main(argv: Sequence[str] | None = None) -> int:
    """Feed the readers, and tell what was found."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=5.0, help="for all readers together")
    parser.add_argument("--runs", type=int, default=0, help="inputs of each reader, at most")
    parser.add_argument("--jobs", type=int, default=1, help="readers at a time")
    parser.add_argument("--targets", nargs="+", choices=ROWS, default=list(ROWS), metavar="READER")
    parser.add_argument("--corpus", type=Path, default=REPOSITORY / "build" / "fuzz", metavar="DIR")
    parser.add_argument("--child", help=argparse.SUPPRESS)
    parser.add_argument("--seconds", type=int, default=0, help=argparse.SUPPRESS)
    parser.add_argument("--memory", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--replay", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args(argv)
    folder = options.corpus.absolute()
    if options.replay is not None:
        return replay(options.child, options.replay.absolute())
    if options.child is not None:
        run_child(
            options.child,
            folder=folder,
            memory=options.memory,
            seconds=options.seconds,
            runs=options.runs,
        )
        return 0
    folder.mkdir(parents=True, exist_ok=True)
    seconds = options.minutes * 60 * options.jobs / len(options.targets)
    return _run_all(options.targets, folder, seconds, options)


def _run_all(
    names: Sequence[str], folder: Path, seconds: float, options: argparse.Namespace
) -> int:
    """Run the readers side by side, and tell and note each when it is done."""
    stop = threading.Event()
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # ends all as Ctrl-C does
    done: list[Campaign] = []
    with ThreadPoolExecutor(options.jobs) as pool:
        work = {
            pool.submit(
                run_reader, Campaign(name, folder), seconds=seconds, runs=options.runs, stop=stop
            )
            for name in names
        }
        while work:
            try:
                ended, work = wait(work, return_when=FIRST_COMPLETED)
            except KeyboardInterrupt:
                print("stopping; what was found stays", flush=True)
                stop.set()
                continue
            for future in ended:
                done.append(future.result())
                _tell(done[-1])
    tried, failed = sum(one.tried for one in done), sum(one.failed for one in done)
    causes = sum(len(one.causes) for one in done)
    print(f"{tried:,} inputs, of which {failed:,} failed, of {causes} causes")
    return int(causes > 0)


def _tell(campaign: Campaign) -> None:
    """Print what was done to a reader."""
    if not campaign.tried and not campaign.causes:
        return  # stopped before its turn
    speed = campaign.tried / max(campaign.seconds, 1e-9)
    print(f"{campaign.name}: {campaign.tried:,} inputs, {speed:,.0f} a second", flush=True)
    for cause in campaign.causes:
        print(f"  {cause}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
