"""Write the files of a leaderboard: a page for people, JSON for programs.

OUT/leaderboard.json    every metric
OUT/leaderboard.html    the tables and the figures as one page
OUT/MASK.png            a figure for each kind of mask
OUT/SHA256SUMS          the seal of all files, written last: its presence means finished
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from bsg_data.dataset.manifest import MANIFEST
from bsg_data.files import AnyPath, encode_json, list_files, noting_failures, write_bytes
from bsg_data.places import taken
from bsg_data.results import write_into
from bsg_data.seal import SEAL, read_seal, refuse_other_results, write_seal
from bsg_models.evaluation.bootstrap import Estimate
from bsg_models.evaluation.catalogue import head_value, list_added_values
from bsg_models.evaluation.verdict import HEADLINES
from bsg_models.rendering.figures import plot_leaderboard
from bsg_models.rendering.pages import Table, write_report
from bsg_models.studies.leaderboard import DATASET, Leaderboard, ModelResult

REPORT, _PAGE = "leaderboard.json", "leaderboard.html"
_REFERENCE = "gamma-poisson"  # the model whose likelihood counts as 1
_HIDDEN, _UNVISITED, _WHOLE = HEADLINES.values()
_RANKED_BY = "rooms/hidden_nll"
_Results = Mapping[str, ModelResult]  # of one kind of mask


class LeaderboardReport(NamedTuple):
    """The files of a leaderboard."""

    summary: dict[str, Any]  # the leaderboard as JSON
    report: Path  # file of the summary
    page: Path  # all tables and figures
    figures: tuple[Path, ...]  # one per kind of mask
    notes: tuple[str, ...]  # about figures that cannot be drawn


def refuse_finished(out: AnyPath, *, force: bool) -> None:
    """Refuse a folder with a finished leaderboard unless `force`, and a folder with other results.

    Raises:
        DatasetError: if there is a finished leaderboard, or results of another command.
    """
    out = Path(out)
    refuse_other_results(out, REPORT)
    is_begun = any(out.glob(f"*/{DATASET}/{MANIFEST}"))
    for name in (SEAL,) if is_begun else (SEAL, REPORT, _PAGE):
        if (out / name).exists() and not force:
            raise taken(out / name)


def report_leaderboard(board: Leaderboard, out: AnyPath) -> LeaderboardReport:
    """Write the files of a leaderboard."""
    out = Path(out)
    summary = write_json(board)
    with write_into(out, force=True) as staged:
        figures: dict[str, Path] = {}
        notes: list[str] = []
        for mask, results in board.results.items():
            with noting_failures(notes):
                _plot(results, staged / f"{mask}.png", mask, seeds=board.recipe.seeds)
                figures[f"{mask} masks"] = staged / f"{mask}.png"
        _write_page(board, staged / _PAGE, figures)
        write_bytes(staged / REPORT, (encode_json(summary, indent=1) + "\n").encode())
        write_seal(staged, list_files(staged))
        old = read_seal(out) or {}
        (out / SEAL).unlink(missing_ok=True)
        for name in old.keys() - list_files(staged):
            (out / name).unlink(missing_ok=True)
    return LeaderboardReport(
        summary,
        report=out / REPORT,
        page=out / _PAGE,
        figures=tuple(out / path.name for path in figures.values()),
        notes=tuple(notes),
    )


def summary_rows(results: dict[str, ModelResult]) -> tuple[list[str], list[list[str]]]:
    """Return header and rows of the table for a terminal, the best model first."""
    columns = _HIDDEN[:6]
    rows = []
    for name in _rank_models(results):
        point, seconds = results[name].metrics.point, results[name].seconds
        rows.append([name, *(f"{point[column]:.4f}" for column in columns), f"{seconds:.1f}"])
    return ["model", *map(head_value, columns), "training, s"], rows


def write_json(board: Leaderboard) -> dict[str, Any]:
    """Return a leaderboard as JSON.

    `masks` → mask → model → `seconds`, number of `seeds`, `trained_on` (a kind of mask), `metrics`
    (value, interval, nodes), and `nll_over_gamma_poisson`, if that is there.
    """
    return {
        "recipe": board.recipe.model_dump(mode="json"),
        "dataset": {
            "sources": [source.model_dump(mode="json") for source in board.manifest.sources],
            "class_space": board.manifest.class_space.name,
            "scenes": board.manifest.totals.scenes,
            "rooms": board.manifest.totals.rooms,
        },
        "masks": {
            mask: {
                name: {
                    "seconds": round(result.seconds, 2),
                    "seeds": result.seeds,
                    "trained_on": result.trained_on or mask,
                    "nll_over_gamma_poisson": _encode(compare(results, name)),
                    "metrics": {k: _encode(e) for k, e in result.metrics.estimates().items()},
                }
                for name, result in results.items()
            }
            for mask, results in board.results.items()
        },
    }


def compare(results: _Results, name: str) -> Estimate | None:
    """Return the paired ratio of a model's hidden NLL over rooms to that of `gamma-poisson`."""
    reference = results.get(_REFERENCE)
    return results[name].metrics.ratio(reference.metrics, _RANKED_BY) if reference else None


def _rank_models(results: _Results) -> list[str]:
    """Return the models by rising hidden NLL over rooms."""
    return sorted(results, key=lambda name: results[name].metrics.point[_RANKED_BY])


def say_means(seeds: int) -> tuple[str, str]:
    """Return what the values of a leaderboard are means over, and its intervals are over."""
    if seeds == 1:
        return "the folds", "buildings"
    return f"the folds and {seeds} seeds", "buildings and seeds"


def _say_what(board: Leaderboard) -> str:
    """Return what was measured, and what the values are."""
    recipe, totals = board.recipe, board.manifest.totals
    means, intervals = say_means(recipe.seeds)
    return (
        f"{totals.scenes} buildings, {totals.rooms:,} rooms, class map "
        f"{board.manifest.class_space.name}; {recipe.folds} folds by building, {recipe.draws} "
        f"masks of every test building that hide {100 * recipe.fraction:g} %, seed {recipe.seed}. "
        f"Values are means over {means}; ± is half the 95 % interval over "
        f"{intervals}. docs/evaluation.md defines the metrics."
    )


def _write_page(board: Leaderboard, path: Path, figures: Mapping[str, Path]) -> None:
    """Write a leaderboard as one page: a table for each mask and topic, and every metric."""
    facts = [_say_what(board)]
    models = next(iter(board.results.values())).items()
    own = [f"{name} ({model.trained_on} masks)" for name, model in models if model.trained_on]
    if own:
        facts.append(f"One model in every table: {', '.join(own)}.")
    write_report(
        path,
        title="Leaderboard",
        facts=facts,
        tables=[
            table
            for tabulate in (_tabulate_topics, _tabulate_all)
            for mask, results in board.results.items()
            for table in tabulate(mask, results)
        ],
        figures=figures,
    )


def _tabulate_topics(mask: str, results: _Results) -> Iterator[Table]:
    """Yield a table of each topic of headlines, a row for each model, the best first."""
    ranked = _rank_models(results)
    for topic, headlines in {**HEADLINES, "other packages": list_added_values()}.items():
        table = {head_value(name): _cells(results, name) for name in headlines}
        known = {head: cells for head, cells in table.items() if {*cells} != {"–"}}
        if known:
            columns = {"model": ranked, **known}
            if headlines == _HIDDEN and _REFERENCE in results:
                ratios = (compare(results, name) for name in ranked)
                columns[f"NLL / {_REFERENCE}"] = [ratio.show(4) for ratio in ratios if ratio]
            rows = list(zip(*columns.values(), strict=True))
            yield Table(f"Masks {mask}: {topic}", list(columns), rows)


def _tabulate_all(mask: str, results: _Results) -> Iterator[Table]:
    """Yield the table of every metric, a column for each model."""
    ranked = _rank_models(results)
    metrics = results[ranked[0]].metrics.point
    rows = [[name, *_cells(results, name)] for name in metrics]
    yield Table(f"Every metric, masks {mask}", ["metric", *ranked], rows, folded=True)


def _cells(results: _Results, name: str) -> list[str]:
    """Return a value of every model, the best model first."""
    return [results[model].metrics.estimate(name).show(4) for model in _rank_models(results)]


def _encode(estimate: Estimate | None) -> dict[str, float | int | None] | None:
    return None if estimate is None or np.isnan(estimate.value) else estimate.encode()


def _plot(results: _Results, path: Path, mask: str, *, seeds: int) -> None:
    headlines = (*_HIDDEN, *_WHOLE, *(_UNVISITED if mask != "uniform" else ()))
    labels = {name: head_value(name) for name in headlines}
    estimates = {name: results[name].metrics.estimates() for name in _rank_models(results)}
    over = say_means(seeds)[1]
    title = f"`{mask}` masks; 95 % intervals over {over}; dashed: the best; grey: outside"
    plot_leaderboard(estimates, labels, path, title=title)
