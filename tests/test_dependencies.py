"""Every dependency has an upper bound, and what `make` installs has a hash."""

from __future__ import annotations

import re
from collections.abc import Iterator

from conftest import REPOSITORY, load_script, read_pins, tomllib

LOCKS = [f"requirements-{name}.lock" for name in ("torch-cpu", "torch", "demo", "test")]
PINNED = re.compile(
    r"^([a-z0-9-]+)==([0-9][\w.+]*)((?: \\\n    --hash=sha256:[0-9a-f]{64})+)$", re.M
)


def requirements() -> Iterator[str]:
    """Yield every requirement of pyproject.toml but the project's own extras."""
    with (REPOSITORY / "pyproject.toml").open("rb") as file:
        said = tomllib.load(file)
    yield from said["build-system"]["requires"]
    yield from said["project"]["dependencies"]
    for lines in said["project"]["optional-dependencies"].values():
        yield from (line for line in lines if not line.startswith(said["project"]["name"]))


def read_lock() -> dict[str, str]:
    _, torch, demo, test = map(read_pins, LOCKS)
    assert not demo.keys() & test.keys(), "make test adds to what make demo installs"
    return torch | demo | test


def test_every_requirement_has_both_bounds() -> None:
    listed = list(requirements())
    assert len(listed) > 40
    for line in listed:
        wanted = line.partition(";")[0]
        assert ">=" in wanted, f"{line}: no lower bound"
        assert re.search(r"<[0-9]", wanted), f"{line}: no upper bound"


def test_every_requirement_has_a_reason() -> None:
    lines = (REPOSITORY / "pyproject.toml").read_text("utf-8").splitlines()
    for requirement in requirements():
        found = [line for line in lines if f'"{requirement}"' in line]
        assert found
        assert all("  # " in line for line in found), f"{requirement}: say what it is for"


def test_every_file_of_the_lock_has_a_hash() -> None:
    text = "".join((REPOSITORY / name).read_text("utf-8") for name in LOCKS)
    body = "".join(line for line in text.splitlines(True) if not line.startswith("#"))
    pinned = PINNED.findall(body)
    assert len(pinned) > 100
    whole = "".join(f"{name}=={version}{hashes}\n" for name, version, hashes in pinned)
    assert whole == body, "a line is neither a pin nor a hash"


def test_the_lock_has_the_versions_of_the_constraints() -> None:
    locked, constrained = read_lock(), read_pins("constraints.txt")
    assert read_pins("requirements-torch-cpu.lock")["torch"].partition("+")[0] == locked["torch"]
    assert constrained.items() <= locked.items(), "scripts/write_lock.py makes it"


def test_a_lock_is_split_by_names() -> None:
    one, two = (f"    --hash=sha256:{digit * 64}" for digit in "12")
    torch, rest = f"torch==2.13.0+cpu \\\n{one} \\\n{two}\n", f"torch-geometric==3 \\\n{one}\n"
    split = load_script("write_lock").split(f"a==1 \\\n{two}\n{torch}{rest}", {"torch", "b"})
    assert split == (torch, f"a==1 \\\n{two}\n{rest}")


def test_the_demo_needs_few_packages() -> None:
    demo = read_pins("requirements-demo.lock").keys()
    assert len(demo) <= 57, "with torch, pip and the project at most 60"
    with (REPOSITORY / "pyproject.toml").open("rb") as file:
        project = tomllib.load(file)["project"]
    listed = [*project["dependencies"], *project["optional-dependencies"]["train"]]
    needed = {re.split(r"[<>=\[; ]", line)[0] for line in listed if "< '3.11'" not in line}
    assert needed - {project["name"], "torch"} <= demo, "scripts/write_lock.py makes it"
