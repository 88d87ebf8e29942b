"""Write the generated parts of the docs: tables, helps, files, and what commands print.

A part stands between `<!-- generated: KIND NAME -->` and `<!-- end -->`. `make docs` runs this;
`tests/test_docs.py` fails when a part is not what this would write.
"""

from __future__ import annotations

import re
import shlex
import sys
from collections.abc import Iterator
from pathlib import Path

import click
from click.testing import CliRunner

from bsg_cli.registry import COMMANDS
from bsg_data.dataset.card import column_table
from bsg_data.dataset.schema import SPLITS, TABLES, pairs_schema
from bsg_data.scene.class_map import load_class_map
from bsg_data.tables import format_markdown
from bsg_models.evaluation.catalogue import METRICS
from bsg_models.search.catalogue import PLANNERS
from bsg_models.zoo.catalogue import ZOO

DOCS = Path(__file__).resolve().parent.parent
WIDTHS = {"terminal_width": 88, "max_content_width": 88}
READS = {"none": "costs", "belief": "costs, belief", "truth": "costs, the truth"}
PART = re.compile(r"(<!-- generated: (\S+) (.+?) -->\n).*?(<!-- end -->)", re.DOTALL)


def find_documents() -> list[Path]:
    """Return every document that may have generated parts."""
    pages = sorted((DOCS / "docs").glob("*.md")) + sorted((DOCS / "docs/results").glob("*.md"))
    return [DOCS / "README.md", *pages]


def renew(text: str) -> str:
    """Return a document with its generated parts written anew."""
    return PART.sub(lambda m: f"{m[1]}{_generate(m[2], m[3])}\n{m[4]}", text)


def _generate(kind: str, name: str) -> str:
    if kind == "columns":
        schemas = {**TABLES, "splits": SPLITS, "pairs": pairs_schema(45)}
        return "\n".join(column_table(schemas[name]))
    if kind == "classes":
        loaded = load_class_map(name)
        rows = zip(range(len(loaded.classes)), loaded.classes, loaded.definitions, strict=True)
        return "\n".join(format_markdown(list(rows), header=("index", "class", "definition")))
    if kind == "zoo":
        rows = [(f"`{name}`", ZOO[name].describe()) for name in ZOO]
        return "\n".join(format_markdown(rows, header=("name", "what it is")))
    if kind == "planners":
        header = ("planner", "what it does", "so that", "reads")
        return "\n".join(format_markdown([*map(_describe_planner, PLANNERS)], header=header))
    if kind == "metrics":
        header = ("metric", "in tables", "better", "of", "what it is")
        return "\n".join(format_markdown([*map(_describe_metric, METRICS)], header=header))
    if kind == "helps":
        return "\n".join(_list_helps())
    if kind == "file":
        text = (DOCS / "docs" / name).read_text("utf-8").rstrip()
        return f"```{Path(name).suffix.removeprefix('.')}\n{text}\n```"
    if kind in ("run", "run-with-notes"):
        printed = _run(name, notes=kind == "run-with-notes")
        return f"```sh\n{name}\n```\n\n```text\n{printed}\n```"
    raise ValueError(f"no generated part of kind {kind!r}")


def _list_helps() -> Iterator[str]:
    """Yield a heading and the help of each program, and of the commands of its groups."""
    for name, command in COMMANDS.items():
        yield f"\n## {name}\n"
        yield from _show_helps(name, click.Context(command, info_name=name, **WIDTHS))


def _show_helps(name: str, context: click.Context) -> Iterator[str]:
    command = context.command
    if not isinstance(command, click.Group):
        yield f"```text\n{command.get_help(context).rstrip()}\n```"
        return
    for child, below in command.commands.items():
        yield f"\n### {name} {child}\n"
        inner = click.Context(below, info_name=child, parent=context, **WIDTHS)
        yield from _show_helps(f"{name} {child}", inner)


def _describe_planner(name: str) -> tuple[str, ...]:
    planner = PLANNERS[name]
    does = (planner.choose.__doc__ or "–").strip().splitlines()[0].rstrip(".")
    return f"`{name}`", does, planner.so_that, READS[planner.reads]


def _describe_metric(name: str) -> tuple[str, ...]:
    metric = METRICS[name]
    better = "–" if metric.less is None else "less" if metric.less else "more"
    return f"`{name}`", metric.label, better, ", ".join(metric.node_sets), metric.about


def _run(line: str, *, notes: bool) -> str:
    """Return what a command prints, with its notes or without; its files are those of `docs`."""
    name, *words = shlex.split(line)
    files = {
        path.relative_to(place).as_posix(): str(path)
        for place in (DOCS, DOCS / "docs")
        for path in (DOCS / "docs").iterdir()
    }
    done = CliRunner().invoke(COMMANDS[name], [files.get(word, word) for word in words])
    if done.exit_code:
        raise ValueError(f"{line}: {done.output}")
    printed = done.output if notes else done.stdout
    there = f"{DOCS}/" if "docs/" in line else f"{DOCS / 'docs'}/"
    return printed.replace(there, "").rstrip()


def main() -> int:
    """Renew all documents; say which changed."""
    for path in find_documents():
        old = path.read_text("utf-8")
        new = renew(old)
        if new != old:
            path.write_text(new, "utf-8")
            print(f"renewed {path.relative_to(DOCS)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
