"""Write the generated parts of the docs: tables, helps, files, what commands print, a demo page.

A part stands between `<!-- generated: KIND NAME -->` and `<!-- end -->`. `make docs` runs this;
`tests/test_docs.py` fails when a part is not what this would write.
"""

from __future__ import annotations

import json
import re
import shlex
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import click
from click.testing import CliRunner

from bsg_cli.registry import COMMANDS
from bsg_data.dataset.card import column_table
from bsg_data.dataset.schema import SPLITS, TABLES, pairs_schema
from bsg_data.scene.class_map import load_class_map
from bsg_data.seal import read_seal, write_seal
from bsg_data.tables import format_markdown
from bsg_models.evaluation.catalogue import METRICS
from bsg_models.search.catalogue import PLANNERS
from bsg_models.zoo.catalogue import ZOO

DOCS = Path(__file__).resolve().parent.parent
WIDTHS = {"terminal_width": 88, "max_content_width": 88}
READS = {"none": "costs", "belief": "costs, belief", "truth": "costs, the truth"}
FIGURES = "docs/results/figures.json"
WEIGHTS = DOCS / "weights"
DEMO = "docs/assets/demo.html"  # the explorer of docs/home.json
COMPARED = {  # model of the README's table → what it is
    "ceci-60": "the paper's network",
    "ceci-block-60": "the same, read literally",
    "doubled": "twice what was seen",
    "universal": "ours, shipped",
}
PAPER = ("What it predicts", "Statistical distance")
SAVED = "33.8 · 45.5"  # by the paper, section IV-D, in per cent
SAVINGS = (  # measurement, and planner
    ("paper_search", "greedy-share"),
    ("paper_search_every", "greedy-share"),
    ("paper_search", "expected-cost"),
)
SHOWN = ("NLL ↓", "AUROC unseen ↑", "top 3 unseen ↑")
# What a page says under a table whose data did more than test.
WARNINGS = {
    "unseen": "",
    "training": "**Measured on buildings that the model was trained on.**",
    "chosen": "**Settings of ours were chosen on these data.**",
}
PART = re.compile(r"(<!-- generated: (\S+) (.+?) -->\n).*?(<!-- end -->)", re.DOTALL)


def find_documents() -> list[Path]:
    """Return every document that may have generated parts."""
    folders = (DOCS / "docs", DOCS / "docs/results", WEIGHTS)
    return [DOCS / "README.md", *(page for one in folders for page in sorted(one.glob("*.md")))]


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
        header = ("metric", "in tables", "what it is")
        return "\n".join(format_markdown([*map(_describe_metric, METRICS)], header=header))
    if kind == "figures":
        return "\n".join(_show_figures(name))
    if kind == "made":
        rows = [_describe_measurement(one) for one in name.split()]
        return "\n".join(format_markdown(rows, header=("figures", "command", "commit")))
    if kind == "accuracy":
        return "\n".join(_show_accuracy(name))
    if kind == "results":
        return "\n".join(RESULTS[name]())
    if kind == "helps":
        return "\n".join(_list_helps())
    if kind == "file":
        text = (DOCS / "docs" / name).read_text("utf-8").rstrip()
        return f"```{Path(name).suffix.removeprefix('.')}\n{text}\n```"
    if kind in ("run", "run-with-notes"):
        printed = _run(name, notes=kind == "run-with-notes")
        return f"```sh\n{name}\n```\n\n```text\n{printed}\n```"
    raise ValueError(f"no generated part of kind {kind!r}")


def _read_figures() -> dict[str, Any]:
    return dict(json.loads((DOCS / FIGURES).read_text("utf-8")))


def _find_table(measurement: str, title: str) -> dict[str, Any]:
    return dict(_read_figures()[measurement]["tables"][title])


def _show_figures(name: str) -> list[str]:
    """Return a table of `MEASUREMENT/TITLE`, or a part: `… | COLUMN; COLUMN | START OF A CELL`."""
    place, columns, some, *_ = (*name.split(" | "), "", "")
    table = _find_table(*place.split("/", 1))
    header, warning = table["header"], WARNINGS[table["tested_on"]]
    chosen = [header.index(one) for one in columns.split("; ")] if columns else range(len(header))
    rows = [[row[n] for n in chosen] for row in table["rows"]]
    rows = [row for row in rows if any(cell.startswith(some) for cell in row)]
    shown = format_markdown(rows, header=[header[n] for n in chosen])
    return [*shown, "", warning] if warning else shown


def _count_buildings(measurement: str, title: str) -> str:
    """Return how many buildings a table says that it was measured on."""
    return re.findall(r"(\d+) buildings", _find_table(measurement, title)["reading"])[0]


def _describe_measurement(name: str) -> tuple[str, ...]:
    made = _read_figures()[name]["made"]
    command = f"`{made['command']}`"
    if "last_in" in made:  # the script has left the tree
        command += f" at {made['last_in']}"
    return name, command, made["commit"]


def _find_cell(measurement: str, title: str, column: str, *row: str) -> str:
    """Return the cell of a column, in the row that begins with some cells."""
    table = _find_table(measurement, title)
    place = [name.split(" (")[0].strip("`") for name in table["header"]].index(column)
    (found,) = [
        cells[place]
        for cells in table["rows"]
        if tuple(cell.strip("`") for cell in cells[: len(row)]) == row
    ]
    return str(found)


def _compare_models() -> list[str]:
    """Return the README's table of models: what each predicts, and what a search by it saves."""
    told, moments = (_find_table("paper", title)["rows"] for title in PAPER)
    header = _find_table("paper", PAPER[0])["header"]
    rows = []
    for model, what in COMPARED.items():
        name, reads, *values = _first(told, f"`{model}`")
        found = dict(zip(header[2:], values, strict=True))
        distances = _first(moments, name)
        saved = [
            " · ".join(_find_saved(name, *how, task) for task in ("single", "all"))
            for how in SAVINGS
        ]
        cells = [found[column].split(" (")[0] for column in SHOWN]
        distance = f"{distances[2]} · {distances[6]}"
        told_labels = ", told kinds of rooms" if reads == "yes" else ""
        rows.append((f"{name}, {what}{told_labels}", *cells, distance, *saved))
    paper = _first(moments, "the paper")
    rows.append(("the paper", "–", "–", "–", f"{paper[2]} · {paper[6]}", SAVED, "–", "–"))
    header = (
        *("model", *SHOWN, "Wasserstein · energy ↓"),
        *("travel saved by the paper's rule, %: one · all", "the same, any thing", "our planner"),
    )
    return format_markdown(rows, header=header)


def _find_saved(name: str, measurement: str, planner: str, task: str) -> str:
    """Return what searches in the paper's kind of world save; – if nobody searched."""
    key = [name, f"`{planner}`", f"`{task}`"]
    found = [
        row for row in _find_table(measurement, "The paper's system")["rows"] if row[:3] == key
    ]
    return found[0][4].split(" (")[0] if found else "–"


def _show_accuracy(model: str) -> list[str]:
    """Return the table of a model card: the model's rows of the leaderboard."""
    tables = {"half of every room hidden": "uniform", "half of the rooms not entered": "rooms"}
    columns = ("NLL ↓", "NLL ÷ gamma-poisson", "AUROC unseen ↑", "calibration error ↓")
    rows = [
        (what, *(_find_cell("leaderboard", f"Masks: {mask}", one, model) for one in columns))
        for what, mask in tables.items()
    ]
    return format_markdown(rows, header=("HM3D", *columns))


def _tell_robots() -> list[str]:
    """Return the README's table of what a robot gains."""
    who, three = "expected-cost", ("singles", "A saving, read in three ways")
    saved = _find_cell("search", "Task `single`", "layout", "universal@mixed", who)
    median, mean = (
        _find_cell(*three, f"{one} search", "single", who) for one in ("median", "mean")
    )
    ratios = _find_table("rooms_found", "Objects expected ÷ objects there")["rows"]
    ranked = _find_table("labels", "AUROC of rooms not entered, by label")["rows"]
    labelled, unlabelled = (cell.split()[0] for cell in _first(ranked, "`universal@mixed`")[-2:])
    said = sorted(float(cell) for cell in _first(ratios, "`universal@mixed`")[1:])
    rows = [
        (
            "find one thing in 50 homes, against going to the nearest room; half of all objects "
            "were seen before, kinds of rooms are told",
            f"{saved} % less travel",
        ),
        (
            f"the same, search by search, in {_count_buildings(*three)} of these homes",
            f"median {median} %, mean {mean} %: long searches gain most",
        ),
        (
            "rank what a room that nobody entered contains (AUROC; 0.5 is guessing)",
            f"{labelled} if the room has a label, {unlabelled} if not",
        ),
        ("say on which piece of furniture a thing is, by people's answers", _tell_furniture()),
        (
            "objects expected in rooms not entered ÷ objects there (1 is right), however many "
            "rooms the robot has found",
            f"{said[0]:.2f} to {said[-1]:.2f}",
        ),
    ]
    return format_markdown(rows, header=("task", "with `universal` (95 % interval)"))


def _tell_furniture() -> str:
    """Return what people's answers say of our likelihoods and rankings of furniture."""
    rows = {row[0]: row[1:] for row in _find_table("pieces", "Pieces of a room, by people")["rows"]}
    names = ("ours", "how often people chose a piece", "chance")
    (ranked, loss), (counted, _), (_, chance) = (
        [cell.split(" (")[0] for cell in rows[name]] for name in names
    )
    better = "better" if float(loss) < float(chance) else "worse"
    return (
        f"likelihood **{better} than chance** (log loss {loss}, chance {chance}); ranking {ranked} "
        f"mAP, by a count whatever the thing {counted}"
    )


def _first(rows: list[list[str]], name: str) -> list[str]:
    return next(row for row in rows if row[0] == name)


RESULTS: dict[str, Callable[[], list[str]]] = {
    "paper": _compare_models,
    "robot": _tell_robots,
}


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
    better = "" if metric.less is None else " ↓" if metric.less else " ↑"
    return f"`{name}`", metric.label + better, metric.about


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


def make_demo(path: Path) -> None:
    """Write the page of the README's home."""
    words = [str(DOCS / "docs" / "home.json"), "--out", str(path), "--force"]
    done = CliRunner().invoke(COMMANDS["bsg-belief"], words)
    if done.exit_code:
        raise ValueError(done.output)


def main() -> int:
    """Renew all documents and the demo page; say which changed. Cards are sealed anew."""
    make_demo(DOCS / DEMO)
    for path in find_documents():
        old = path.read_text("utf-8")
        new = renew(old)
        if new != old:
            path.write_text(new, "utf-8")
            print(f"renewed {path.relative_to(DOCS)}")
            if path.parent == WEIGHTS:
                write_seal(WEIGHTS, read_seal(WEIGHTS) or ())
    return 0


if __name__ == "__main__":
    sys.exit(main())
