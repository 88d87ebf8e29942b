"""Feed every reader with millions of inputs, led by which lines they reach: atheris.

    python scripts/faults/fuzz.py --minutes 60

A reader is a target of tests/faults/fuzz, and runs in a process of its own. Its first input that
fails ends it: libFuzzer writes that input to DIR/findings/READER-*. Inputs that reached something
new stay in DIR/corpus/READER, with which a later run goes on. An input that failed belongs into
tests/faults/fuzz/corpus/READER, where the tests replay it.

The exit status is 1 if anything was found.
"""

from __future__ import annotations

import argparse
import random
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(REPOSITORY / "tests" / "faults"))  # before this file: a fuzz.py, too
# Our packages before the tests, which have folders of their names.
sys.path += [str(REPOSITORY), str(REPOSITORY / "tests")]

SECONDS = 5  # that an input may take
MEGABYTES = 2_048  # that a reader may hold, with torch and all


def feed(name: str, folder: Path, flags: Sequence[str]) -> None:
    """Feed a reader in this process, which libFuzzer ends."""
    import atheris

    with atheris.instrument_imports(include=["bsg_data", "bsg_models"]):
        # Imported here alone: what was imported before is not instrumented.
        from fuzz.catalogue import find_target
        from fuzz.mutation import change
        from fuzz.target import Bench

        target = find_target(name)
        bench = Bench(target).__enter__()  # and imports all that it needs
    corpus = folder / "corpus" / name
    for path in (corpus, folder / "findings"):
        path.mkdir(parents=True, exist_ok=True)
    for number, data in enumerate((*target.seeds().values(), *target.kept().values())):
        (corpus / f"seed-{number}").write_bytes(data)

    def try_input(data: bytes) -> None:
        finding = bench.try_input(data)
        if finding is not None:
            raise AssertionError(f"{finding.key}\n{finding.text}")

    def mutate(data: bytes, longest: int, seed: int) -> bytes:
        if seed % 3:  # values and words where libFuzzer, which knows neither, flips bytes
            return change(data, random.Random(seed), most=longest)
        return bytes(atheris.Mutate(data, longest))

    limits = [f"-timeout={SECONDS}", f"-rss_limit_mb={MEGABYTES}", f"-max_len={target.longest}"]
    kept = [f"-artifact_prefix={folder}/findings/{name}-", "-reload=0", *flags, str(corpus)]
    atheris.Setup([sys.argv[0], *limits, *kept], try_input, custom_mutator=mutate)
    atheris.Fuzz()


def main(argv: Sequence[str] | None = None) -> int:
    """Feed the readers one after another, and name those that failed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=5.0, help="for all readers together")
    parser.add_argument("--runs", type=int, default=-1, help="inputs of each reader, at most")
    parser.add_argument("--targets", nargs="+", metavar="READER", help="default: all")
    parser.add_argument("--corpus", type=Path, default=REPOSITORY / "build" / "fuzz", metavar="DIR")
    parser.add_argument("--child", help=argparse.SUPPRESS)
    options = parser.parse_args(argv)
    if options.child:
        limit = f"-max_total_time={int(options.minutes * 60)}"
        feed(options.child, options.corpus.absolute(), [limit, f"-runs={options.runs}"])
        return 0
    from fuzz.catalogue import ROWS

    names = options.targets or ROWS
    words = ["--corpus", str(options.corpus), "--runs", str(options.runs)]
    words += ["--minutes", str(options.minutes / len(names))]
    failed = []
    for name in names:
        command = [sys.executable, __file__, *words, "--child", name]
        done = subprocess.run(command, capture_output=True, text=True)
        print(f"{name}: {done.stderr.splitlines()[-1]}", flush=True)
        if done.returncode:
            failed.append(name)
            print(done.stdout + done.stderr, flush=True)
    print(f"{len(names)} readers, failed: {', '.join(failed) or 'none'}")
    return int(bool(failed))


if __name__ == "__main__":
    sys.exit(main())
