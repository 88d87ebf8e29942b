"""Measure what is known of things that no model counts: against people, real rooms and searches.

    python scripts/measure/any_word.py --leaderboard BOARD --behavior DATASET \
        --housekeep objects.csv --glove FOLDER --wordnet FOLDER --out docs/results/figures.json

`--housekeep` alone prints the benchmark of the shipped table: no other data are needed.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import nouns as table
import numpy as np
import pandas as pd
from nouns import HALF_SEEN, MASKS, HeldOut, Rooms, Sources, average_precision
from results import ResultsTable, format_estimate, write_figures
from scipy.stats import mannwhitneyu

from bsg_data.arrays import Bools, Floats, Ints
from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.shards import read_scene_graphs
from bsg_data.errors import RecipeError
from bsg_data.observation.masked_graph import mask_scene
from bsg_data.observation.partial_graph import PartialGraph, SeenObject
from bsg_data.scene.class_map import load_class_map
from bsg_data.scene.scene_graph import SceneGraph
from bsg_data.tables import format_text
from bsg_models.belief.expectation import Expectation
from bsg_models.evaluation.bootstrap import estimate_value, weigh_buildings
from bsg_models.runs.predictor import Predictor
from bsg_models.search.catalogue import PLANNERS
from bsg_models.search.room_graphs import WorldRecipe, sample_travel
from bsg_models.search.simulator import Answer, Episodes, Robot, search
from bsg_models.zoo.model import one_thread

PUBLISHED = {
    "GloVe, tuned": "ap_glove",
    "RoBERTa, tuned": "ap_roberta",
    "language model, not tuned": "ap_zero_shot",
}
LEAST_HIDDEN = 5  # half-seen rooms that hide a word, for an area under its curve
RESAMPLES = 2000
WORLDS = ("star", "complete", "tree")
EPISODES = 10


def interval(values: Floats, *, weights: Floats | None = None) -> str:
    """Return a mean and its 95 % interval over resampled rows, or a ratio of sums with weights."""
    weights = np.ones(len(values)) if weights is None else weights
    drawn = weigh_buildings(len(values), resamples=RESAMPLES, seed=0)
    means = (values * weights) @ drawn / (weights @ drawn)
    estimate = estimate_value(means[0], means[1:], nodes=len(values), rule="percentile")
    return format_estimate(estimate, digits=3)


# Housekeep


def rank_objects(objects: pd.DataFrame) -> pd.DataFrame:
    """Return the objects with our average precision, and whether a class answers."""
    homes, rows = table.label_homes(), []
    for name, correct in zip(objects["object"], objects["correct"], strict=True):
        try:
            scores = np.array([home.where(name)[0].probability for home in homes])
        except RecipeError:
            rows.append((np.nan, False))
            continue
        has_class = homes[0].understand(name).class_name is not None
        rows.append((average_precision(scores, correct), has_class))
    return objects.assign(ap=[ap for ap, _ in rows], counted=[counted for _, counted in rows])


def report_housekeep(path: Path) -> ResultsTable:
    """Return the mean average precision of the test objects, beside the published ones."""
    ranked = rank_objects(table.read_housekeep(path))
    test = ranked[ranked["split"] == "test"]
    groups = {
        f"all {len(test)}": test,
        f"the {test['counted'].sum()} with a class": test[test["counted"]],
        f"the {(~test['counted']).sum()} without one": test[~test["counted"]],
    }
    rows = [["ours", *[interval(g["ap"].fillna(0.0).to_numpy()) for g in groups.values()]]]
    for name, column in PUBLISHED.items():
        rows.append([name, *[f"{g[column].astype(float).mean():.3f}" for g in groups.values()]])
    gains = [g["ap"].fillna(0.0) - g["ap_roberta"].astype(float) for g in groups.values()]
    rows.append(["ours − RoBERTa", *[interval(gain.to_numpy()) for gain in gains]])
    reading = (
        "Average precision of the ranking of 17 rooms, for the objects of Housekeep's test split "
        "that have a correct room; ours has 95 % intervals over objects. Rooms are empty and "
        "labelled. Train and val taught the table; test did not, and chose nothing. "
        f"{ranked['ap'].notna().sum()} of its {len(ranked)} objects are understood."
    )
    return ResultsTable("Where people say that things belong", ["", *groups], rows, reading)


# Words that were held out


def weigh_classes(sources: Sources, words: Sequence[str]) -> dict[str, Floats]:
    """Return the rivals: in which of the 45 classes each sees a word, in shares `[W, C]`."""
    classes = load_class_map().classes
    both = [np.array([sources.lexicon.meaning(w) for w in some]) for some in (words, classes)]
    unit = [part / np.linalg.norm(part, axis=1, keepdims=True) for part in both]
    cosine = unit[0] @ unit[1].T
    taken = {
        "cosine of GloVe": np.exp(cosine / 0.1),
        "the most similar class": np.eye(len(classes))[cosine.argmax(axis=1)],
        "mean over classes": np.ones(cosine.shape),
    }
    return {name: weights / weights.sum(axis=1, keepdims=True) for name, weights in taken.items()}


def areas(hidden: Floats, scores: Floats) -> Floats:
    """Return the area under the ROC curve of each word `[W]`; NaN if it is hidden too seldom."""
    found = np.full(hidden.shape[1], np.nan)
    for word, (there, score) in enumerate(zip(hidden.T > 0, scores.T, strict=True)):
        if there.sum() >= LEAST_HIDDEN:
            above = mannwhitneyu(score[there], score[~there]).statistic
            found[word] = above / (there.sum() * (~there).sum())
    return found


def half_seen(rooms: Rooms) -> Floats:
    """Return the believed hidden content `[R, C]` of half-seen rooms."""
    half = rooms.take(names=(), rows=rooms.masks == HALF_SEEN)
    return np.asarray(np.exp(half.states) * half.shares[:, None])


def report_ranking(sources: Sources, prior: Rooms, held: HeldOut) -> ResultsTable:
    """Return how well rooms are ranked for words that the table was not taught."""
    weights = weigh_classes(sources, held.names)
    ours = areas(held.hidden, held.logs + np.log(held.shares)[:, None])
    is_measured = ~np.isnan(ours)
    believed, tabled = half_seen(sources.hm3d), half_seen(prior)
    rivals = {
        **{f"{name} of `universal`": believed @ weight.T for name, weight in weights.items()},
        "cosine of GloVe, classes of `prior-table`": tabled @ weights["cosine of GloVe"].T,
    }
    rows = [["the table, word held out", interval(ours[is_measured]), ""]]
    for name, scores in rivals.items():
        theirs = areas(held.hidden, scores)
        gain = interval((ours - theirs)[is_measured])
        rows.append([name, interval(theirs[is_measured]), gain])
    reading = (
        f"Macro AUROC of the rooms that hide the word, over {is_measured.sum()} of the wide "
        "classes that the 45 lack: half of every room of HM3D was seen, buildings are predicted by "
        "models that were not trained on them, and the word was left out of every source of the "
        "table. The strengths of the regression were chosen on these words. With 95 % intervals "
        "over words."
    )
    return ResultsTable(
        "Words that the table was not taught", ["by", "AUROC", "gain"], rows, reading
    )


def report_reliability(held: HeldOut) -> ResultsTable:
    """Return predicted and true presence of words, calibrated on the other half of them."""
    order = np.arange(len(held.names)) % 2
    said = np.zeros(held.logs.shape)
    for half in (0, 1):
        others = held._replace(
            logs=held.logs[:, order != half], hidden=held.hidden[:, order != half]
        )
        calibration = table.calibrate(others)
        rates = held.shares[:, None] * calibration.rates(held.logs[:, order == half])
        said[:, order == half] = calibration.presence(rates)
    true, rows, error = held.hidden > 0, [], 0.0
    edges = np.array([0, 0.01, 0.02, 0.05, 0.1, 0.2, 0.3, 1.0])
    bins = np.digitize(said, edges[1:-1])
    for number in range(len(edges) - 1):
        chosen = bins == number
        if chosen.any():
            error += abs((said - true)[chosen].sum()) / said.size
            span = f"{edges[number]:.0%} to {edges[number + 1]:.0%}"
            cells = (
                f"{chosen.sum():,}",
                f"{said[chosen].mean():.3f}",
                f"{true[chosen].mean():.3f}",
            )
            rows.append([span, *cells])
    reading = (
        f"Presence of held-out words in half-seen rooms; the calibration error is {error:.4f}. "
        "Each half of the words is calibrated on the other half."
    )
    header = ["presence said", "rooms and words", "said", "true"]
    return ResultsTable("How sure it is", header, rows, reading)


# Searches


class Searched:
    """One building that is searched for words, as a robot that saw half of it knows it."""

    def __init__(self, graph: SceneGraph, partial: PartialGraph, predictor: Predictor) -> None:
        self._partial, self._predictor = partial, predictor
        rooms = {str(room.region_id): room.room_index for room in graph.rooms}
        self._node_of = {rooms[room.name]: node for node, room in enumerate(partial.rooms, 1)}
        self._whole: dict[int, list[SeenObject]] = defaultdict(list)
        self.counts: dict[str, Counter[int]] = defaultdict(Counter)
        for thing in graph.objects:
            node = self._node_of.get(thing.room_index)
            word = table.word_of(thing.category)
            if node is None:
                continue
            known = predictor.class_map.classify(thing.raw_category)
            seen = SeenObject(
                f"{thing.instance_id}", node, thing.raw_category, known.category, known.class_index
            )
            self._whole[node].append(seen)
            if word is not None:
                self.counts[word][node] += 1

    @property
    def nodes(self) -> int:
        """Number of nodes, the building included."""
        return len(self._partial.rooms) + 1

    def believe(self, entered: frozenset[int], word: str) -> Expectation:
        """Return what the model believes once some rooms were entered; the word is not told."""
        seen = [
            thing
            for thing in self._partial.objects
            if thing.room_index not in entered and table.word_of(thing.category) != word
        ]
        seen += [thing for node in sorted(entered) for thing in self._whole[node]]
        rooms = tuple(
            replace(room, hidden_share=0.0, visited=True) if node in entered else room
            for node, room in enumerate(self._partial.rooms, 1)
        )
        return self._predictor(replace(self._partial, rooms=rooms, objects=tuple(seen)))


def search_building(
    building: Searched,
    tables: Mapping[str, table.Rates],
    rivals: Mapping[str, Mapping[str, Floats]],
    calibration: table.Calibration,
    *,
    scene: str,
) -> dict[tuple[str, str], float]:
    """Return the cost of all searches of a building, by world and by what the robot goes by."""
    rng = np.random.default_rng(len(scene) + building.nodes)
    words = [w for w in tables if 0 < len(building.counts[w]) < building.nodes - 1]
    if not words:
        return {}
    sought = [words[int(rng.integers(len(words)))] for _ in range(EPISODES)]
    instances = np.zeros((EPISODES, building.nodes, 1), np.int64)
    for episode, word in enumerate(sought):
        for node, count in building.counts[word].items():
            instances[episode, node, 0] = count
    lacking = [np.flatnonzero(one[1:, 0] == 0) + 1 for one in instances]
    starts = np.array([nodes[int(rng.integers(len(nodes)))] for nodes in lacking])
    rooms = np.arange(building.nodes) > 0

    @cache
    def believe(entered: frozenset[int], word: str) -> Expectation:
        return building.believe(entered, word)

    def presence(kind: str, entered: Bools, word: str) -> Floats:
        belief = believe(frozenset(np.flatnonzero(entered).tolist()), word)
        if kind != OURS:
            return np.asarray(-np.expm1(-belief.hidden @ rivals[kind][word]))
        share = belief.hidden.sum(axis=1) / np.maximum(belief.expected.sum(axis=1), 1e-9)
        logs = tables[word].log_rates([word], table.describe_state(belief.expected))[:, 0]
        return calibration.presence(share * calibration.rates(logs))

    costs = {}
    for name in WORLDS:
        travel = sample_travel(
            WorldRecipe(kind=name), nodes=building.nodes, episodes=EPISODES, scene_id=scene, seed=0
        )
        episodes = Episodes(travel, rooms, starts, np.zeros((EPISODES, 1), np.int64), instances)
        nearest = search(episodes, {"nearest": Robot(PLANNERS["nearest"], "single")})
        costs[name, "nearest"] = float(nearest["nearest"].costs.sum())
        for kind in (OURS, *rivals):

            def beliefs(
                rows: Ints, explored: Bools, *, shares: bool = True, kind: str = kind
            ) -> Answer:
                said = [
                    presence(kind, entered, sought[row])[:, None]
                    for row, entered in zip(rows.tolist(), explored, strict=True)
                ]
                return np.stack(said), np.stack(said)

            robot = {kind: Robot(PLANNERS["expected-cost"], "single")}
            costs[name, kind] = float(search(episodes, robot, beliefs=beliefs)[kind].costs.sum())
    return costs


OURS = "the table, word held out"


def report_search(sources: Sources, board: Path, calibration: table.Calibration) -> ResultsTable:
    """Return what a search for a held-out word costs less than going to the nearest room."""
    names = table.held_out_classes(sources.hm3d)
    fold_of = {word: number % 5 for number, word in enumerate(names)}
    tables = {}
    for fold in range(5):
        out = [word for word in names if fold_of[word] == fold]
        tables |= dict.fromkeys(out, table.learn(sources.without(out)))
    weights = weigh_classes(sources, names)
    rivals = {kind: dict(zip(names, rows, strict=True)) for kind, rows in weights.items()}
    predictors = table.fold_predictors(board, "mixed", "universal")
    space, found = Dataset.open(board / "mixed" / "dataset").manifest.class_space, []
    for graph in read_scene_graphs(board / "mixed" / "dataset"):
        partial = mask_scene(graph, MASKS[HALF_SEEN], draw=0, class_space=space)
        building = Searched(graph, partial, predictors(graph.scene_id))
        if costs := search_building(building, tables, rivals, calibration, scene=graph.scene_id):
            found.append(costs)
            print(f"searched {graph.scene_id}", file=sys.stderr, flush=True)
    frame = pd.DataFrame(found)
    rows = []
    for kind in (OURS, *rivals):
        cells = [
            interval(
                1 - (frame[w, kind] / frame[w, "nearest"]).to_numpy(),
                weights=frame[w, "nearest"].to_numpy(),
            )
            for w in WORLDS
        ]
        rows.append([kind, *cells])
    reading = (
        f"Share of the cost saved against the nearest room, {EPISODES} searches for one of the "
        f"held-out words in each of {len(found)} buildings, by `expected-cost`. Half of the "
        "building was seen before, but no object of the word. With 95 % intervals over buildings."
    )
    return ResultsTable("What it saves in a search", ["by", *WORLDS], rows, reading)


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, and write the tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    table.add_options(parser, optional=True)
    parser.add_argument("--out", type=Path, help="JSON of figures; else it is printed")
    options = parser.parse_args(arguments)
    tables = [report_housekeep(options.housekeep)]
    if options.out is None:
        print(format_text(tables[0].rows, header=tables[0].header))
        return 0
    sources = table.read_sources(options)
    sources = replace(sources, objects=sources.objects[sources.objects["split"] != "test"])
    held = table.hold_out(sources)
    with one_thread():
        data = options.leaderboard / "mixed" / "dataset"
        prior = table.observe_rooms(
            data, table.fold_predictors(options.leaderboard, "uniform", "prior-table")
        )
        tables += [report_ranking(sources, prior, held), report_reliability(held)]
        tables.append(report_search(sources, options.leaderboard, table.calibrate(held)))
    write_figures(options.out, "any_word", tables, argv=sys.argv, data=Dataset.open(data))
    return 0


if __name__ == "__main__":
    sys.exit(main())
