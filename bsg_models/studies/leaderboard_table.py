"""Format a leaderboard: Markdown for people, JSON for programs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from bsg_data.tables import escape_markdown, format_markdown, mark_code
from bsg_models.evaluation.bootstrap import Estimate
from bsg_models.evaluation.catalogue import find_value, head_value, label_value
from bsg_models.evaluation.measurement import EVALUATOR_VERSION
from bsg_models.evaluation.metrics import MOMENTS
from bsg_models.evaluation.verdict import HEADLINES, judge
from bsg_models.studies.leaderboard import Leaderboard, ModelResult

REFERENCE = "gamma-poisson"  # the model whose likelihood counts as 1
CONSTANT = "train-mean"  # the model that predicts the same for every unvisited room
HIDDEN, UNVISITED, WHOLE = HEADLINES.values()
RANKED_BY = "rooms/hidden_nll"


def write_json(board: Leaderboard) -> dict[str, Any]:
    """Return a leaderboard as JSON.

    `masks` → mask → model → `seconds`, `trained_on` (a kind of mask), `metrics` (value, interval,
    nodes), and the values of `compare`.
    """
    masks: dict[str, Any] = {}
    for mask, results in board.results.items():
        masks[mask] = {
            name: {
                "seconds": round(result.seconds, 2),
                "trained_on": result.trained_on or mask,
                **{k: _plain(v) for k, v in compare(results, name).items()},
                "metrics": {k: _plain(e) for k, e in result.metrics.estimates().items()},
            }
            for name, result in results.items()
        }
    return {
        "evaluator_version": EVALUATOR_VERSION,
        "recipe": board.recipe.model_dump(mode="json"),
        "dataset": {
            "sources": [one.model_dump(mode="json") for one in board.manifest.sources],
            "class_space": board.manifest.class_space.name,
            "scenes": board.manifest.totals.scenes,
            "rooms": board.manifest.totals.rooms,
        },
        "masks": masks,
    }


def compare(results: Mapping[str, ModelResult], name: str) -> dict[str, Estimate | None]:
    """Return a model's paired comparisons; None if the model to compare with is missing.

    `nll_over_gamma_poisson` is a ratio of hidden NLL over rooms. `unvisited_ap_minus_train_mean` is
    a difference of average precision over unvisited rooms. `nll_minus_best` is a difference of
    hidden NLL over rooms.
    """
    ours, ap = results[name].metrics, UNVISITED[0]
    reference, constant = (results.get(other) for other in (REFERENCE, CONSTANT))
    best = results[rank_models(results)[0]].metrics
    return {
        "nll_over_gamma_poisson": ours.ratio(reference.metrics, RANKED_BY) if reference else None,
        "unvisited_ap_minus_train_mean": (
            ours.difference(constant.metrics, ap) if constant else None
        ),
        "nll_minus_best": ours.difference(best, RANKED_BY),
    }


def rank_models(results: Mapping[str, ModelResult]) -> list[str]:
    """Return the models by rising hidden NLL over rooms."""
    return sorted(results, key=lambda name: results[name].metrics.point[RANKED_BY])


def write_markdown(board: Leaderboard) -> str:
    """Return a leaderboard as a Markdown document."""
    recipe, totals = board.recipe, board.manifest.totals
    lines = [
        "# Leaderboard",
        "",
        f"{totals.scenes} buildings, {totals.rooms:,} rooms, class map "
        f"{escape_markdown(board.manifest.class_space.name)}; {recipe.folds} folds by building, "
        f"{recipe.draws} masks of every test building that hide {100 * recipe.fraction:g} %, "
        f"seed {recipe.seed}. "
        "Values and training times are means over the folds; ± is half the 95 % interval over "
        "buildings. Bold marks the best of a column, and each model that the paired interval "
        "cannot distinguish from it. docs/evaluation.md defines the metrics.",
        "",
        *_own_masks(board),
    ]
    for mask, results in board.results.items():
        lines += [
            f"## Masks: {escape_markdown(mask)}",
            "",
            *_headline_tables(results),
            *_moments(results),
        ]
    for mask, results in board.results.items():
        lines += [f"## Every metric, masks {escape_markdown(mask)}", "", *_everything(results)]
    return "\n".join(lines)


def _own_masks(board: Leaderboard) -> Iterator[str]:
    """Yield the models that were trained once for all kinds of masks, with their mask."""
    own = {
        name: result.trained_on
        for results in board.results.values()
        for name, result in results.items()
        if result.trained_on
    }
    for name, mask in own.items():
        yield (
            f"{mark_code(name)} was trained once, on {mark_code(mask)} masks, and is the same "
            "model in every table."
        )
        yield ""


def _headline_tables(results: Mapping[str, ModelResult]) -> Iterator[str]:
    names = rank_models(results)
    some_unvisited = not np.isnan(results[names[0]].metrics.point[UNVISITED[0]])
    bold = _mark_best(results, HIDDEN)
    rows = {
        name: [
            *_cells(results[name], HIDDEN, bold=bold[name]),
            _cell(compare(results, name)["nll_over_gamma_poisson"]),
            f"{results[name].seconds:.1f}",
        ]
        for name in names
    }
    yield from _table(
        rows, ["model", *map(head_value, HIDDEN), "NLL / gamma-poisson", "training, s"]
    )
    yield from _explain(HIDDEN)
    if some_unvisited:
        bold = _mark_best(results, UNVISITED)
        rows = {
            name: [
                *_cells(results[name], UNVISITED, bold=bold[name]),
                _cell(compare(results, name)["unvisited_ap_minus_train_mean"]),
            ]
            for name in names
        }
        yield from _table(rows, ["model", *map(head_value, UNVISITED), "AP micro − train-mean"])
        yield from _explain(UNVISITED)
        yield (
            "Whole histograms have no bold values here: in an unvisited room, a model that "
            "predicts nothing is at half the largest distance, nearer than an honest guess."
        )
        yield ""
    bold = _mark_best(results, () if some_unvisited else WHOLE)
    rows = {name: _cells(results[name], WHOLE, bold=bold[name]) for name in names}
    yield from _table(rows, ["model", *map(head_value, WHOLE)])
    yield from _explain(WHOLE)


def _explain(headlines: tuple[str, ...]) -> Iterator[str]:
    yield "Columns: " + ", ".join(f"{label_value(name)} is `{name}`" for name in headlines) + "."
    yield ""


def _moments(results: Mapping[str, ModelResult]) -> Iterator[str]:
    """Yield the paper's Table I in its four-column form."""
    yield "The paper's Table I: distances of the probabilities as values, rooms and buildings."
    yield ""
    header = [f"{letter} {moment}" for letter in "WE" for moment in MOMENTS]
    rows = {
        name: [
            f"{results[name].metrics.point[f'all/{metric}_values/{moment}']:.3g}"
            for metric in ("wasserstein", "energy")
            for moment in MOMENTS
        ]
        for name in rank_models(results)
    }
    yield from _table(rows, ["model", *header])


def _everything(results: Mapping[str, ModelResult]) -> Iterator[str]:
    estimates = {name: results[name].metrics.estimates() for name in rank_models(results)}
    metrics = next(iter(estimates.values()))
    rows = [
        [f"`{metric}`", *(_cell(one[metric]) for one in estimates.values())] for metric in metrics
    ]
    yield from format_markdown(rows, header=["metric", *map(escape_markdown, estimates)])
    yield ""


def _mark_best(
    results: Mapping[str, ModelResult], headlines: tuple[str, ...]
) -> dict[str, frozenset[str]]:
    """Return model → headlines in which it is the best, or not distinguishable from the best."""
    marked: dict[str, set[str]] = {name: set() for name in results}
    for headline in headlines:
        values = {name: result.metrics.point[headline] for name, result in results.items()}
        known = [name for name, value in values.items() if not np.isnan(value)]
        if not known:
            continue
        choose = min if find_value(headline)[0].less else max
        best = results[choose(known, key=lambda name: values[name])].metrics
        for name in known:
            if judge(results[name].metrics, best, headline) == "not distinguishable":
                marked[name].add(headline)
    return {name: frozenset(some) for name, some in marked.items()}


def _cells(result: ModelResult, headlines: tuple[str, ...], *, bold: frozenset[str]) -> list[str]:
    cells = {name: _cell(result.metrics.estimate(name)) for name in headlines}
    return [f"**{cell}**" if name in bold else cell for name, cell in cells.items()]


def _cell(estimate: Estimate | None) -> str:
    if estimate is None or np.isnan(estimate.value):
        return "–"
    half = (estimate.high - estimate.low) / 2
    value = f"{estimate.value:.4g}"
    return value if np.isnan(half) else f"{value} ± {half:.2g}"


def _plain(estimate: Estimate | None) -> dict[str, float | int | None] | None:
    if estimate is None or np.isnan(estimate.value):
        return None
    numbers = {"value": estimate.value, "low": estimate.low, "high": estimate.high}
    return {
        **{k: v if np.isfinite(v) else None for k, v in numbers.items()},
        "nodes": estimate.nodes,
    }


def _table(rows: Mapping[str, list[str]], header: list[str]) -> Iterator[str]:
    """Yield a table with one row per model."""
    named = [[escape_markdown(name), *cells] for name, cells in rows.items()]
    yield from format_markdown(named, header=header)
    yield ""
