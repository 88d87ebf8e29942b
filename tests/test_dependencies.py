"""Every dependency has an upper bound, and what `make` installs has a hash."""

from __future__ import annotations

import re
from collections.abc import Iterator

from conftest import REPOSITORY, load_script, tomllib

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


def read_pins(name: str) -> dict[str, str]:
    text = (REPOSITORY / name).read_text("utf-8")
    return dict(re.findall(r"^([A-Za-z0-9-]+)==([^\s\\]+)", text, re.MULTILINE))


def test_every_requirement_has_both_bounds() -> None:
    listed = list(requirements())
    assert len(listed) > 40
    for line in listed:
        wanted = line.partition(";")[0]
        assert ">=" in wanted, f"{line}: no lower bound"
        assert re.search(r"<[0-9]", wanted), f"{line}: no upper bound"


def test_every_file_of_the_lock_has_a_hash() -> None:
    text = (REPOSITORY / "requirements.lock").read_text("utf-8")
    body = "".join(line for line in text.splitlines(True) if not line.startswith("#"))
    pinned = PINNED.findall(body)
    assert len(pinned) > 100
    whole = "".join(f"{name}=={version}{hashes}\n" for name, version, hashes in pinned)
    assert whole == body, "a line is neither a pin nor a hash"


def test_the_lock_has_the_versions_of_the_constraints() -> None:
    locked, constrained = read_pins("requirements.lock"), read_pins("constraints.txt")
    fuzz = {"atheris"}  # is of the extra `fuzz`, which `make install` does not need
    assert constrained.keys() - locked.keys() <= fuzz, "make lock"
    assert {name: locked[name] for name in constrained.keys() - fuzz} == {
        name: version for name, version in constrained.items() if name not in fuzz
    }


def test_the_lock_holds_all_that_the_tests_ask_for() -> None:
    with (REPOSITORY / "pyproject.toml").open("rb") as file:
        project = tomllib.load(file)["project"]
    groups, wanted = project["optional-dependencies"], list(project["dependencies"])
    seen, todo = set(), ["test"]
    while todo:
        extra = todo.pop()
        if extra not in seen:
            seen.add(extra)
            for line in groups[extra]:
                own = re.fullmatch(rf"{project['name']}\[(.*)\]", line)
                todo += own[1].split(",") if own else []
                wanted += [] if own else [line]
    needed = {
        re.split(r"[<>=\[; ]", line)[0] for line in wanted if "python_version < '3.11'" not in line
    }
    assert needed <= read_pins("requirements.lock").keys(), "make lock"


def test_both_builds_of_torch_are_in_a_lock_that_is_made() -> None:
    one, two = (f"--hash=sha256:{digit * 64}" for digit in "12")
    lock = f"a==1 \\\n    {two}\ntorch==2.13.0+cpu \\\n    {two}\nz==3 \\\n    {one}\n"
    made = load_script("write_lock").join_torch(lock, f"torch==2.13.0 \\\n    {one}\n")
    assert made == (
        f"a==1 \\\n    {two}\ntorch==2.13.0 \\\n    {one} \\\n    {two}\nz==3 \\\n    {one}\n"
    )
