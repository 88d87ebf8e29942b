"""Make the table of nouns: what rooms an everyday thing is in that no model counts.

    python scripts/measure/nouns.py --leaderboard BOARD --behavior DATASET --housekeep objects.csv \
        --glove FOLDER --wordnet FOLDER --out bsg_robot/tables/nouns-v1.safetensors

GloVe 6B (public domain) says which words are alike, WordNet 3.0 which are physical things. The rate
of a noun in a room is a bilinear function of its features and of what `universal` believes of the
room (`bsg_robot.answers.nouns`). It is learned by Poisson regression from the categories of HM3D
and BEHAVIOR in masked rooms, and by logistic regression from Housekeep's train and val objects.
The same inputs give the same bytes.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter, defaultdict
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
import torch
from lexicon import Lexicon, list_words, read_lexicon
from scipy.optimize import minimize, minimize_scalar

from bsg_data.arrays import Bools, Floats, Ints
from bsg_data.dataset.dataset import Dataset, read_splits
from bsg_data.dataset.shards import read_scene_graphs
from bsg_data.recipes import MaskRecipe
from bsg_data.scene.class_map import is_nameless, load_class_map
from bsg_data.scene.scene_graph import SceneGraph
from bsg_models.belief.masked_graph import mask_scene
from bsg_models.runs.found_model import WIDE_MAP
from bsg_models.runs.predictor import Predictor
from bsg_models.zoo.model import one_thread
from bsg_robot.answers.nouns import (
    HEAD,
    NounTable,
    describe_state,
    split_head,
    write_nouns,
)
from bsg_robot.answers.seen_building import open_graph

MASKS = (
    MaskRecipe(strategy="uniform", fraction=0.25),
    MaskRecipe(strategy="uniform", fraction=0.5),
    MaskRecipe(strategy="rooms"),
)
HALF_SEEN = 1  # of MASKS
DRAWS = 2  # of each mask
LEAST_ROOMS = 3  # a category in fewer says too little
RANK = 16  # of the vectors
EVERY_ROOM = (
    *("bathroom", "bedroom", "childs_room", "closet", "corridor", "dining_room", "exercise_room"),
    *("garage", "home_office", "kitchen", "living_room", "lobby", "pantry_room", "playroom"),
    *("storage_room", "television_room", "utility_room"),
)


class Fit(NamedTuple):
    """Strengths of the regression, chosen on held-out words and Housekeep's train and val."""

    taxonomy: float = 1.2  # of WordNet's features against GloVe's
    kin: float = 0.5  # weight of a word's relatives in its vector
    ridge: float = 50.0
    behavior: float = 0.1  # weight of BEHAVIOR's rooms
    housekeep: float = 1.0
    basis: int = 80  # features kept
    steps: int = 40


TUNED = Fit()

# Words


class Features:
    """The features of words: GloVe's vectors beside WordNet's ancestors, in a common basis."""

    def __init__(self, lexicon: Lexicon, words: Sequence[str], fit: Fit) -> None:
        self._lexicon, self._kin = lexicon, fit.kin
        parts = {part for word in words for part in self._split(word)}
        counted = Counter(a for part in sorted(parts) for a in lexicon.physical(part))
        often = [a for a, n in counted.items() if 4 <= n < 0.8 * len(parts)]
        self._column = {ancestor: column for column, ancestor in enumerate(sorted(often))}
        self._mean = np.zeros(lexicon.vectors.shape[1] + len(self._column))
        raw = np.stack([self._raw(word) for word in words])
        self._mean, self._scale = raw.mean(axis=0), raw.std(axis=0)
        size = lexicon.vectors.shape[1]
        self._scale[:size] *= np.sqrt(size)
        spread = (raw[:, size:] - self._mean[size:]).var(axis=0).sum()
        self._scale[size:] = np.sqrt(spread) / max(fit.taxonomy, 1e-9)
        scaled = (raw - self._mean) / self._scale
        self._basis = np.linalg.svd(scaled, full_matrices=False)[2][: fit.basis]

    def __call__(self, words: Sequence[str]) -> Floats:
        """Return the features of words `[W, D]`."""
        raw = np.stack([self._raw(word) for word in words])
        return np.asarray((raw - self._mean) / self._scale @ self._basis.T)

    def _split(self, word: str) -> list[str]:
        before, head = split_head(word)
        return [one for part in (head, *before) if (one := self._lexicon.find(part)) is not None]

    def _raw(self, word: str) -> Floats:
        parts = self._split(word)
        if not parts:
            return self._mean
        head, *before = (self._of_one(part) for part in parts)
        return HEAD * head + (1 - HEAD) * np.mean(before, axis=0) if before else head

    def _of_one(self, word: str) -> Floats:
        above = np.zeros(len(self._column))
        for ancestor, weight in self._lexicon.physical(word).items():
            if ancestor in self._column:
                above[self._column[ancestor]] = weight
        row, kin = self._lexicon.rank[word], self._kin
        vector = (1 - kin) * self._lexicon.vectors[row] + kin * self._lexicon.relatives[row]
        return np.concatenate([vector, above])


# Rooms


@dataclass(frozen=True, eq=False)
class Rooms:
    """Masked rooms of one source, and what they hide.

    Attributes:
        names: `[W]` words.
        counts: `[R, W]` hidden objects.
        states: `[R, C]` log of the believed contents.
        shares: `[R]` part of the believed content that is hidden, above 0.
        masks: `[R]` index of its mask in `MASKS`.
        scenes: `[R]` building and mask, as `NAME/DRAW`.
    """

    names: tuple[str, ...]
    counts: Floats
    states: Floats
    shares: Floats
    masks: Ints
    scenes: tuple[str, ...]

    def take(self, *, names: Collection[str] | None = None, rows: Bools | None = None) -> Rooms:
        """Return some of the words and rooms."""
        kept = [w for w in self.names if names is None or w in names]
        columns = [self.names.index(word) for word in kept]
        which = np.flatnonzero(np.ones(len(self.masks), bool) if rows is None else rows)
        return Rooms(
            tuple(kept),
            self.counts[np.ix_(which, columns)],
            self.states[which],
            self.shares[which],
            self.masks[which],
            tuple(self.scenes[row] for row in which),
        )


@cache
def _words_of_categories() -> tuple[dict[str, str], frozenset[str]]:
    wide = load_class_map(WIDE_MAP)
    entries = wide.entries.values()
    classes = {
        str(e.category): wide.classes[e.class_index] for e in entries if e.class_index is not None
    }
    structure = wide.structure | load_class_map("behavior45-v1").structure
    return classes, frozenset(structure)


def word_of(category: str | None) -> str | None:
    """Return the word that a category is counted as: its wide class if it has one."""
    classes, structure = _words_of_categories()
    if category is None or category in structure or is_nameless(category):
        return None
    return classes.get(category, category)


def observe_rooms(dataset: Path, models: Callable[[str], Predictor]) -> Rooms:
    """Mask the buildings of a dataset, and ask a model about each room that hides something.

    Args:
        dataset: in the class space of the models.
        models: scene → the model to ask, which was not trained on it where one is at hand.
    """
    found: dict[str, list[tuple[int, int]]] = defaultdict(list)
    states, shares, masks, scenes = [], [], [], []
    space = Dataset.open(dataset).manifest.class_space
    for graph in read_scene_graphs(dataset):
        predictor, whole = models(graph.scene_id), _count_words(graph)
        for number, mask in enumerate(MASKS):
            for draw in range(DRAWS):
                partial = mask_scene(graph, mask, draw=draw, class_space=space)
                belief = predictor(partial)
                left = Counter((o.room_index, word_of(o.category)) for o in partial.objects)
                rooms = {str(room.region_id): room.room_index for room in graph.rooms}
                for node, room in enumerate(partial.rooms, 1):
                    hidden = belief.hidden[node].sum()
                    if hidden <= 0:
                        continue
                    for word, count in whole[rooms[room.name]].items():
                        if count > left[node, word]:
                            found[word].append((len(states), count - left[node, word]))
                    states.append(describe_state(belief.expected[node]))
                    shares.append(hidden / belief.expected[node].sum())
                    masks.append(number)
                    scenes.append(f"{graph.scene_id}/{draw}")
        print(f"{graph.scene_id}: {len(states):,} rooms", file=sys.stderr, flush=True)
    least = LEAST_ROOMS * len(MASKS) * DRAWS / 2  # a mask hides about half
    names = sorted(word for word, rows in found.items() if len(rows) >= least)
    counts = np.zeros((len(states), len(names)), np.float32)
    for column, word in enumerate(names):
        for row, count in found[word]:
            counts[row, column] = count
    arrays = (np.array(states), np.array(shares), np.array(masks))
    return Rooms(tuple(names), counts, *arrays, tuple(scenes))


def _count_words(graph: SceneGraph) -> dict[int, Counter[str]]:
    counted: dict[int, Counter[str]] = defaultdict(Counter)
    for thing in graph.objects:
        if (word := word_of(thing.category)) is not None:
            counted[thing.room_index][word] += 1
    return counted


def ask_labelled_rooms(predictor: Predictor) -> Floats:
    """Return the states `[17, C]` of Housekeep's rooms: empty, labelled, each in its own home."""
    contents = []
    for room in EVERY_ROOM:
        said = {"id": room, "room_type": room.replace("_", " "), "visited": False}
        home = {"scene_id": room, "building_kind": "home", "rooms": [said], "objects": []}
        contents.append(predictor(open_graph(home).graph).expected[1])
    return describe_state(np.array(contents))


def read_housekeep(path: Path) -> pd.DataFrame:
    """Return Housekeep's objects that have a room, with the column `correct` `[17]`."""
    objects = pd.read_csv(path, keep_default_na=False)
    objects = objects[objects["rooms"] != ""].copy()
    objects["correct"] = [
        np.isin(EVERY_ROOM, rooms.split()).astype(float) for rooms in objects["rooms"]
    ]
    return objects


@dataclass(frozen=True, eq=False)
class Sources:
    """All that a table is learned from."""

    lexicon: Lexicon
    hm3d: Rooms
    behavior: Rooms
    labelled: Floats  # [17, C] states of Housekeep's rooms
    objects: pd.DataFrame  # of Housekeep

    @property
    def words(self) -> list[str]:
        """All words that are counted somewhere."""
        every = (*self.hm3d.names, *self.behavior.names, *self.objects["object"])
        return list(dict.fromkeys(every))

    def without(self, words: Collection[str]) -> Sources:
        """Return the sources without some words and objects."""
        hm3d, behavior = (
            rooms.take(names=set(rooms.names) - set(words)) for rooms in (self.hm3d, self.behavior)
        )
        objects = self.objects[~self.objects["object"].isin(words)]
        return replace(self, hm3d=hm3d, behavior=behavior, objects=objects)


# The regression


@dataclass(frozen=True, eq=False)
class Rates:
    """A fitted regression: log rate = b0 + x · a + (s − m) / d · (xᵀ B + q)."""

    features: Features
    matrix: Floats  # [D + 1, C]: B, then q
    slopes: Floats  # [D + 1]: a, then b0
    mean: Floats
    deviation: Floats

    def log_rates(self, words: Sequence[str], states: Floats) -> Floats:
        """Return log rates `[R, W]`."""
        x = np.hstack([self.features(words), np.ones((len(words), 1))])
        z = (states - self.mean) / self.deviation
        return np.asarray(z @ (x @ self.matrix).T + x @ self.slopes)


def fit_rates(sources: Sources, features: Features, fit: Fit) -> Rates:
    """Learn from counts of words in rooms, and from where people say that objects belong.

    A word has an offset of its own, which is shrunk towards what its features say. Words count by
    the root of their number, lest a few decide.
    """
    hm3d, behavior, objects = sources.hm3d, sources.behavior, sources.objects
    mean, deviation = hm3d.states.mean(axis=0), hm3d.states.std(axis=0)

    def load(values: Floats) -> torch.Tensor:
        return torch.tensor(values, dtype=torch.float64)

    def of_words(words: Sequence[str]) -> torch.Tensor:
        x = features(words) if len(words) else np.zeros((0, fit.basis))
        return load(np.hstack([x, np.ones((len(words), 1))]))

    counted = []
    for rooms, weight in ((hm3d, 1.0), (behavior, fit.behavior)):
        words = 1 / torch.sqrt(load(rooms.counts).sum(dim=0) + 30)
        z = load((rooms.states - mean) / deviation)
        shares = torch.log(load(rooms.shares))[:, None]
        counted.append((of_words(rooms.names), z, shares, load(rooms.counts), weight * words))
    x_objects, z_objects = (
        of_words(list(objects["object"])),
        load((sources.labelled - mean) / deviation),
    )
    correct = load(np.array(list(objects["correct"])).reshape(-1, len(z_objects)))
    size = x_objects.shape[1]
    matrix, slopes = torch.zeros(size, len(mean)).double(), torch.zeros(size).double()
    offsets = [torch.zeros(len(x)).double() for x in (counted[0][0], counted[1][0], x_objects)]
    shifts = torch.zeros(2).double()  # of BEHAVIOR and of Housekeep against HM3D
    free = [matrix, slopes, shifts, *offsets]
    for one in free:
        one.requires_grad_()
    optimiser = torch.optim.LBFGS(
        free, max_iter=fit.steps, history_size=20, line_search_fn="strong_wolfe"
    )

    def loss() -> torch.Tensor:
        optimiser.zero_grad()
        total = fit.ridge * (matrix[:-1] ** 2).sum() + 0.1 * (matrix[-1] ** 2).sum()
        total = total + (slopes[:-1] ** 2).sum() + 0.3 * sum((o**2).sum() for o in offsets)
        for number, (x, z, shares, counts, weights) in enumerate(counted):
            logs = z @ (x @ matrix).T + x @ slopes + offsets[number] + shares
            logs = logs + (shifts[0] if number else 0.0)
            total = total + ((torch.exp(logs) - counts * logs).sum(dim=0) * weights).sum()
        logits = (z_objects @ (x_objects @ matrix).T + offsets[2] + shifts[1]).T
        said = torch.nn.functional.binary_cross_entropy_with_logits(
            logits, correct, reduction="sum"
        )
        total = total + fit.housekeep * said
        total.backward()
        return total

    optimiser.step(loss)
    return Rates(features, matrix.detach().numpy(), slopes.detach().numpy(), mean, deviation)


# Held-out words


class HeldOut(NamedTuple):
    """What the regression says of words, and of Housekeep's objects, that it did not see."""

    names: tuple[str, ...]
    logs: Floats  # [R, W] in half-seen rooms
    shares: Floats  # [R] part of the content that is hidden
    hidden: Floats  # [R, W]
    scenes: tuple[str, ...]  # [R], as `NAME/DRAW`
    precision: dict[str, float]  # object → average precision


def held_out_classes(hm3d: Rooms) -> tuple[str, ...]:
    """Return the wide classes that the 45 do not have, as far as rooms hide them."""
    wide, narrow = load_class_map(WIDE_MAP).classes, load_class_map().classes
    return tuple(word for word in hm3d.names if word in wide and word not in narrow)


def hold_out(sources: Sources) -> HeldOut:
    """Predict every word outside the 45 classes by a regression without it, fold by fold.

    A word is left out of all sources; so are the objects of Housekeep, by their names.
    """
    rng, folds = np.random.default_rng(0), 5
    hm3d, objects = sources.hm3d, sources.objects
    of_word = {w: int(rng.integers(folds)) for w in held_out_classes(hm3d)}
    of_object = {name: of_word.get(name, int(rng.integers(folds))) for name in objects["object"]}
    half = hm3d.take(names=of_word, rows=hm3d.masks == HALF_SEEN)
    logs, precision = np.zeros(half.counts.shape), {}
    for fold in range(folds):
        out = {w for w, k in (of_word | of_object).items() if k == fold}
        rates = learn(sources.without(out))
        asked = [w for w, k in of_word.items() if k == fold]
        columns = [half.names.index(word) for word in asked]
        logs[:, columns] = rates.log_rates(asked, half.states)
        tested = objects[objects["object"].isin(out)]
        scores = rates.log_rates(list(tested["object"]), sources.labelled).T
        for name, score, correct in zip(tested["object"], scores, tested["correct"], strict=True):
            precision[name] = average_precision(score, correct)
    return HeldOut(half.names, logs, half.shares, half.counts, half.scenes, precision)


def average_precision(scores: Floats, correct: Floats) -> float:
    """Return the average precision of a ranking; ties in the given order.

    >>> average_precision(np.array([3.0, 2.0, 1.0]), np.array([1.0, 0.0, 1.0]))  # (1 + 2/3) / 2
    0.8333333333333333
    """
    hits = correct[np.argsort(-scores, kind="stable")]
    return float((np.cumsum(hits) / np.arange(1, len(hits) + 1))[hits > 0].mean())


class Calibration(NamedTuple):
    """What makes held-out presence right: log rate → shift + slope · log rate, and a dispersion."""

    shift: float
    slope: float
    dispersion: float

    def presence(self, rates: Floats) -> Floats:
        """Return P(at least one) by the calibrated rates."""
        return np.asarray(-np.expm1(-self.dispersion * np.log1p(rates / self.dispersion)))

    def rates(self, logs: Floats) -> Floats:
        """Return calibrated rates, of rooms that hide everything, of the predicted log rates."""
        return np.asarray(np.exp(self.shift + self.slope * logs))


def calibrate(held: HeldOut) -> Calibration:
    """Return the calibration of held-out words in half-seen rooms.

    Shift and slope are the likeliest for the presence in rooms. The dispersion is the likeliest for
    the presence in their buildings: it says how sure the rate of a word is.
    """
    there = held.hidden > 0
    group = pd.factorize(np.array(held.scenes))[0]
    anywhere = _sum_groups(there, group) > 0

    def fit_rooms(dispersion: float) -> Calibration:
        def loss(free: Floats) -> float:
            said = Calibration(free[0], np.exp(free[1]), dispersion)
            return _log_loss(said.presence(held.shares[:, None] * said.rates(held.logs)), there)

        start = np.array([[0.0, 0.0], [-1.0, 0.0], [0.0, -0.5]])
        options = {"initial_simplex": start, "xatol": 1e-3, "fatol": 1e-7}
        best = minimize(loss, start[0], method="Nelder-Mead", options=options).x
        return Calibration(float(best[0]), float(np.exp(best[1])), dispersion)

    def loss_of_buildings(log_dispersion: float) -> float:
        said = fit_rooms(float(np.exp(log_dispersion)))
        rates = held.shares[:, None] * said.rates(held.logs)
        return _log_loss(said.presence(_sum_groups(rates, group)), anywhere)

    best = minimize_scalar(
        loss_of_buildings, bounds=(-3, 3), method="bounded", options={"xatol": 0.1}
    )
    return fit_rooms(float(np.exp(best.x)))


def _sum_groups(values: Floats | Bools, group: Ints) -> Floats:
    return np.asarray(pd.DataFrame(values).groupby(group).sum())


def _log_loss(said: Floats, true: Bools) -> float:
    said = np.clip(said, 1e-9, 1 - 1e-9)
    return float(-np.where(true, np.log(said), np.log1p(-said)).mean())


# The table


def distil(
    rates: Rates, words: Mapping[str, bool], counted: Sequence[str], calibration: Calibration
) -> NounTable:
    """Return the table of words: their vectors in the directions that matter, in eight bits."""
    every = list(words)
    x = np.hstack([rates.features(every), np.ones((len(every), 1))])
    known = np.hstack([rates.features(counted), np.ones((len(counted), 1))])
    right = np.linalg.svd(known @ rates.matrix, full_matrices=False)[2]
    directions = right[:RANK].T  # [C, K]
    vectors = calibration.slope * (x @ rates.matrix @ directions)
    scale = np.abs(vectors).max(axis=0) / 127
    unit = [
        part / np.linalg.norm(part, axis=1, keepdims=True) for part in (x[:, :-1], known[:, :-1])
    ]
    alike = unit[0] @ unit[1].T - np.equal.outer(np.array(every), np.array(counted))
    near = np.argsort(-alike, axis=1, kind="stable")[:, :3]
    projection = directions / rates.deviation[:, None]
    return NounTable(
        rows={word: row for row, word in enumerate(every)},
        things=np.array(list(words.values())),
        vectors=np.rint(vectors / scale),
        scale=scale,
        bases=calibration.shift + calibration.slope * (x @ rates.slopes),
        near=near,
        counted=tuple(counted),
        projection=projection,
        centre=-rates.mean @ projection,
        dispersion=calibration.dispersion,
    )


def learn(sources: Sources, *, fit: Fit = TUNED) -> Rates:
    """Return the regression on all words of some sources."""
    return fit_rates(sources, Features(sources.lexicon, sources.words, fit), fit)


def read_sources(options: argparse.Namespace) -> Sources:
    """Read what the table is learned from."""
    lexicon = read_lexicon(options.glove, options.wordnet)
    shipped, mixed = Predictor(), options.leaderboard / "mixed"
    with one_thread():
        hm3d = observe_rooms(mixed / "dataset", fold_predictors(mixed))
        behavior = observe_rooms(options.behavior, lambda scene: shipped)
        labelled = ask_labelled_rooms(shipped)
    return Sources(lexicon, hm3d, behavior, labelled, read_housekeep(options.housekeep))


def make_table(sources: Sources) -> NounTable:
    """Return the table that some sources teach, calibrated on words that were held out."""
    held = hold_out(sources)
    calibration = calibrate(held)
    found = np.mean(list(held.precision.values()))
    print(
        f"held out: Housekeep's mean average precision {found:.3f}; {calibration}", file=sys.stderr
    )
    heads = {word: split_head(word)[1] for word in sources.words}
    counted = [word for word, head in heads.items() if sources.lexicon.find(head) is not None]
    words = list_words(sources.lexicon, counted=counted)
    return distil(learn(sources), words, counted, calibration)


def fold_predictors(mixed: Path) -> Callable[[str], Predictor]:
    """Return scene → the model of a leaderboard that was not trained on it."""
    splits = read_splits(mixed / "dataset")
    fold_of = {scene: fold for fold, scenes in splits.items() for scene in scenes}
    asked = {fold: Predictor(mixed / fold / "universal") for fold in splits}
    return lambda scene: asked[fold_of[scene]]


def main(arguments: Sequence[str] | None = None) -> int:
    """Make the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    for option, said in (
        ("housekeep", "its objects.csv"),
        ("leaderboard", "of HM3D, with `mixed`"),
        ("behavior", "dataset of BEHAVIOR"),
        ("glove", "folder of GloVe 6B, 50-d"),
        ("wordnet", "folder of WordNet 3.0"),
    ):
        parser.add_argument(f"--{option}", type=Path, required=True, help=said)
    parser.add_argument("--out", type=Path, required=True, help="file of the table")
    options = parser.parse_args(arguments)
    sources = read_sources(options)
    tuned = sources.objects["split"] != "test"
    sources = replace(sources, objects=sources.objects[tuned])
    write_nouns(make_table(sources), options.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
