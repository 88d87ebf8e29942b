"""The lines of docs/robot-software.md do what the page says, in a shell and in Python."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from dataclasses import fields

import pytest
from conftest import REPOSITORY

from bsg_robot import Place, Step

DOCS = REPOSITORY / "docs"


def read_blocks(name: str, kind: str, address: str) -> list[str]:
    text = (DOCS / "robot-software.md").read_text("utf-8")
    text = text.replace("http://127.0.0.1:8000", address)
    return re.findall(rf"<!-- {name} -->\n```{kind}\n(.*?)```", text, re.DOTALL)


@pytest.mark.skipif(not (shutil.which("curl") and shutil.which("jq")), reason="no curl or no jq")
def test_the_lines_of_curl_are_answered(address: str) -> None:
    lines = "\n".join(read_blocks("http", "sh", address))
    shell = ["bash", "-euo", "pipefail", "-c", f"{{ {lines}\n}} | jq --slurp ."]
    done = subprocess.run(shell, cwd=DOCS, capture_output=True, text=True, check=True)
    find, expect, file, place = json.loads(done.stdout)
    assert find["go_first"] == file["go_first"] == "kitchen"
    assert find["cost_unit"] == "rooms"
    assert (place["room"], place["piece"]) == ("kitchen", "f")
    assert len(expect["rooms"][0]["expected"]) == 3


def test_the_lines_of_the_client_are_answered(address: str) -> None:
    (block,) = read_blocks("mcp", "python", address)
    done = subprocess.run([sys.executable, "-c", block], capture_output=True, text=True, check=True)
    assert done.stdout == "kitchen\n"


def test_the_page_has_all_keys_of_questions_and_answers() -> None:
    from bsg_robot.service.questions import (
        Contents,
        Destination,
        Expect,
        Find,
        Found,
        NextPlace,
        Thing,
    )

    page = (DOCS / "robot-software.md").read_text("utf-8").split("\n## HTTP\n")[1]
    questions, answers = page.split("| answer | meaning |")
    rows = re.findall(r"^\| ([^|]+) \| (`/[^|]+`|all) \|", questions, re.MULTILINE)
    for path, kind in (("`/find`", Find), ("`/next_place`", NextPlace), ("`/expect`", Expect)):
        keys = [key for key, of in rows if path in of or of == "all"]
        assert {*re.findall(r"`(\w+)`", " ".join(keys))} == {*kind.model_fields}
    keys = " ".join(re.findall(r"^\| ([^|]+) \|", answers, re.MULTILINE))
    shown = {*re.findall(r"`(\w+)`", keys)}
    assert {*Found.model_fields, *Destination.model_fields, *Contents.model_fields} <= shown
    (places,) = re.findall(r"^\| `places` \| (.*)", answers, re.MULTILINE)
    assert {field.name for field in fields(Place)} <= {*re.findall(r"`(\w+)`", places)}
    (plan,) = re.findall(r"^\| `plan` \| (.*)", answers, re.MULTILINE)
    assert {field.name for field in fields(Step)} == {*re.findall(r"`(\w+)`", plan)} - {"here"}
    (things,) = re.findall(r"^\| `things` of `/find` \| (.*)", answers, re.MULTILINE)
    names = {field.alias or name for name, field in Thing.model_fields.items()}
    assert names == {*re.findall(r"`(\w+)`", things)}


def test_the_configurations_are_json() -> None:
    blocks = read_blocks("mcp", "json", "")
    assert len(blocks) == 2
    assert all(map(json.loads, blocks))
