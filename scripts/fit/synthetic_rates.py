"""Fit the rates behind `bsg-data synth` on HM3D, and say how close the result is.

Fit:      python scripts/fit/synthetic_rates.py --hm3d-stats PATH/TO/HM3DSem-v0.2-train.zip \
              --annotations PATH/TO/annotations --out bsg_data/synthetic/rates.json
Compare:  the same two inputs with `--compare DIR`, a folder written by `bsg-data synth`; prints the
          Markdown tables of docs/results/synthetic.md.

Only aggregates leave this script: a category is named if at least MIN_SCENES scenes hold it, a
spelling has a share of its own under the same rule, a latent room type occurs in as many scenes.
The model is described in docs/synthetic.md; the fit is deterministic.
"""

from __future__ import annotations

import argparse
import csv
import io
import itertools
import json
import re
import zipfile
from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.special import gammaln
from scipy.stats import gamma, poisson, wasserstein_distance

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

MIN_SCENES = 5
FOLDS = 5
RESTARTS = 3
SPLITS = 20
CANDIDATE_TYPES = (8, 12, 16, 20, 24, 28)
# Public spellings with commas belong to a category of few scenes; so they get chosen shares here.
CHOSEN_SPELLINGS = {
    "magazine": ("magazines, albums", 0.2),
    "book": ("magazines, books and albums", 0.01),
}
ROW = re.compile(r'(\d+),([0-9A-Fa-f]{1,6}),"(.*)",(-?\d+)')
STRUCTURE = re.compile(r"\s*(wall|floor|ceiling|door|window|stairs|beam|column)\b", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class Instance:
    """One annotated object: its scene, id, region, corrected category and raw spelling."""

    scene: str
    number: int
    region: int
    category: str
    raw: str


@dataclass(frozen=True, slots=True)
class Counts:
    """Counts per room and category `[R, C]`, with the building of each room `[R]`.

    The last category is the pool of everything seen in fewer than MIN_SCENES scenes.
    """

    matrix: Floats
    building: Ints
    categories: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Mixture:
    """Latent room types: rates `[K, C]`, shares `[K]`, burst and style shapes `[C]`, size shape."""

    rates: Floats
    shares: Floats
    burst: Floats
    style: Floats
    size: float


# Reading


def read_annotations(folder: Path) -> dict[tuple[str, int], tuple[str, int]]:
    """Read every `*.semantic.txt` below a folder: (scene, id) to (raw name, region)."""
    rows: dict[tuple[str, int], tuple[str, int]] = {}
    for path in sorted(folder.rglob("*.semantic.txt")):
        for line in path.read_text(encoding="utf-8").split("\n")[1:]:
            match = ROW.fullmatch(line)
            if match:
                rows[path.parent.name, int(match[1])] = (match[3], int(match[4]))
            elif line:
                raise SystemExit(f"{path}: not a row of an annotation: {line!r}")
    if not rows:
        raise SystemExit(f"{folder}: no *.semantic.txt below it")
    return rows


def read_instances(archive: Path, annotations: Path) -> list[Instance]:
    """Join the corrected categories of the public statistics with the raw spellings."""
    raw = read_annotations(annotations)
    instances = []
    with zipfile.ZipFile(archive) as bundle:
        (member,) = (name for name in bundle.namelist() if name.endswith("Neighborhoods.csv"))
        text = io.TextIOWrapper(bundle.open(member), encoding="utf-8", newline="")
        for row in csv.DictReader(text):
            scene, region = row["Scene Name"], int(row["Region #"])
            for item in row["Object Instances in Region"].split(":"):
                category, _, number = item.rpartition("_")
                name = raw[scene, int(number)][0]
                instances.append(Instance(scene, int(number), region, category, name))
    return sorted(instances, key=lambda one: (one.scene, one.number))


def count_rooms(instances: Sequence[Instance]) -> Counts:
    """Count corrected categories per room; categories of few scenes share the last column."""
    scenes: defaultdict[str, set[str]] = defaultdict(set)
    for one in instances:
        scenes[one.category].add(one.scene)
    kept = tuple(sorted(name for name in scenes if len(scenes[name]) >= MIN_SCENES))
    column = {name: index for index, name in enumerate(kept)}
    rooms = sorted({(one.scene, one.region) for one in instances})
    row = {room: index for index, room in enumerate(rooms)}
    matrix = np.zeros((len(rooms), len(kept) + 1))
    for one in instances:
        matrix[row[one.scene, one.region], column.get(one.category, len(kept))] += 1
    _, building = np.unique([scene for scene, _ in rooms], return_inverse=True)
    return Counts(matrix, building.astype(np.int64), kept)


# Latent room types


def sum_by_building(values: Floats, building: Ints) -> Floats:
    """Sum rows `[R, C]` per building `[B, C]`."""
    total = np.zeros((int(building.max()) + 1, values.shape[1]))
    np.add.at(total, building, values)
    return total


def room_scales(counts: Floats, styles: Floats, mixture: Mixture) -> Floats:
    """Estimate the size of each room under each type `[R, K]`; bursty categories weigh less."""
    weight = mixture.burst / (mixture.burst + mixture.shares @ mixture.rates)
    expected = styles @ (weight * mixture.rates).T
    return np.asarray((mixture.size + (counts @ weight)[:, None]) / (mixture.size + expected))


def room_log_likelihood(counts: Floats, means: Floats, burst: Floats) -> Floats:
    """Return the negative binomial log likelihood per room `[R]`, without its constant."""
    return np.asarray(
        (counts * np.log(means / burst) - (counts + burst) * np.log1p(means / burst)).sum(axis=1)
    )


def fit_mixture(
    data: Counts, *, types: int, seed: int, rounds: int
) -> tuple[Mixture, Floats, float]:
    """Fit the mixture by expectation-maximisation from a seeded start.

    The factors of rooms (size) and of buildings per category (style) are set to their posterior
    means in each round. Returns the mixture, the type probabilities `[R, K]`, the log likelihood.
    """
    rng = np.random.default_rng(seed)
    y, building = data.matrix, data.building
    rooms, columns = y.shape
    mean = y.mean(axis=0)
    centres = rng.choice(rooms, types, replace=False)
    mixture = Mixture(
        0.5 * mean + 0.5 * y[centres],
        np.full(types, 1 / types),
        np.full(columns, 1.0),
        np.full(columns, 2.0),
        4.0,
    )
    styles = np.ones((int(building.max()) + 1, columns))
    posterior, likelihood = np.empty((rooms, types)), -np.inf
    for step in range(rounds):
        per_room = styles[building]
        scales = room_scales(y, per_room, mixture)
        joint = np.log(mixture.shares) + np.stack(
            [
                room_log_likelihood(y, scales[:, [k]] * per_room * mixture.rates[k], mixture.burst)
                for k in range(types)
            ],
            axis=1,
        )
        top = joint.max(axis=1, keepdims=True)
        posterior = np.exp(joint - top)
        likelihood = float((top[:, 0] + np.log(posterior.sum(axis=1))).sum())
        posterior /= posterior.sum(axis=1, keepdims=True)
        mixture, styles = _maximise(data, mixture, posterior, scales, styles, update=step % 5 == 4)
    return mixture, posterior, likelihood


def _maximise(
    data: Counts,
    mixture: Mixture,
    posterior: Floats,
    scales: Floats,
    styles: Floats,
    *,
    update: bool,
) -> tuple[Mixture, Floats]:
    """Return better rates, shares, styles and, if `update`, better shapes."""
    y, building = data.matrix, data.building
    rates, burst, per_room = mixture.rates.copy(), mixture.burst, styles[building]
    seen, expected, plain = np.zeros_like(y), np.zeros_like(y), np.zeros_like(y)
    prior = y.mean(axis=0)
    for k in range(len(rates)):
        exposure = scales[:, [k]] * per_room
        means = exposure * mixture.rates[k]
        weight = posterior[:, [k]] * burst / (burst + means)
        seen += weight * y
        expected += weight * means
        plain += posterior[:, [k]] * means
        rates[k] = ((weight * y).sum(axis=0) + 0.5 * prior) / (
            (weight * exposure).sum(axis=0) + 0.5
        )
    better = (mixture.style + sum_by_building(seen, building)) / (
        mixture.style + sum_by_building(expected, building)
    )
    shares = (posterior.sum(axis=0) + 1) / (len(y) + len(rates))
    style = mixture.style
    if update:
        excess = ((y - plain) ** 2 - plain).sum(axis=0)
        burst = 1 / np.clip((excess + 0.5) / ((plain**2).sum(axis=0) + 0.5), 0.02, 20)
        plain /= per_room
        total, mean = sum_by_building(y, building), sum_by_building(plain, building)
        noise = mean + sum_by_building(plain**2, building) / burst
        excess = ((total - mean) ** 2 - noise).sum(axis=0)
        style = 1 / np.clip((excess + 0.5) / ((mean**2).sum(axis=0) + 0.5), 0.02, 10)
    return Mixture(rates, shares, burst, style, mixture.size), better


def held_out_likelihood(data: Counts, *, types: int, rounds: int) -> float:
    """Return the mean log likelihood of a room in buildings the mixture was not fitted on."""
    total = 0.0
    nodes = np.array([0.25, 0.5, 0.8, 1.2, 1.8, 2.8])
    for fold in range(FOLDS):
        test = data.building % FOLDS == fold
        _, building = np.unique(data.building[~test], return_inverse=True)
        train = Counts(data.matrix[~test], building.astype(np.int64), data.categories)
        mixture, _, _ = fit_mixture(train, types=types, seed=fold, rounds=rounds)
        burst = 1 / (1 / mixture.burst + 1 / mixture.style + 1 / (mixture.burst * mixture.style))
        prior = nodes ** (mixture.size) * np.exp(-mixture.size * nodes)
        prior /= prior.sum()
        y = data.matrix[test]
        joint = [
            np.log(mixture.shares[k] * prior[i])
            + room_log_likelihood(y, s * mixture.rates[k], burst)
            for k in range(types)
            for i, s in enumerate(nodes)
        ]
        total += float(np.logaddexp.reduce(joint, axis=0).sum())
    return total / len(data.matrix)


def choose_types(data: Counts) -> tuple[Floats, Ints, dict[str, float]]:
    """Choose the number of room types, fit them, and assign every room to one.

    Returns rates `[K, C]` (the types' mean counts, so that totals are conserved), the type of each
    room `[R]`, and the held-out log likelihood of each candidate number.
    """
    scores = {types: held_out_likelihood(data, types=types, rounds=30) for types in CANDIDATE_TYPES}
    best = max(scores, key=lambda types: scores[types])
    fits = [fit_mixture(data, types=best, seed=seed, rounds=80) for seed in range(RESTARTS)]
    _, posterior, _ = max(fits, key=lambda fit: fit[2])
    assigned = posterior.argmax(axis=1)
    spread = [len(set(data.building[assigned == k])) for k in range(best)]
    kept = [k for k in range(best) if spread[k] >= MIN_SCENES]
    assigned = posterior[:, kept].argmax(axis=1)
    rates = np.stack([_shrunk_mean(data.matrix, assigned == k) for k in range(len(kept))])
    members = np.bincount(assigned, minlength=len(kept)).astype(float)
    for _ in range(50):  # rake: totals per category and per type are those of the data
        rates *= data.matrix.sum(axis=0) / (members @ rates)
        sizes = np.bincount(assigned, weights=data.matrix.sum(axis=1)) / members
        rates *= (sizes / rates.sum(axis=1))[:, None]
    return rates, assigned, {str(types): round(score, 2) for types, score in scores.items()}


def _shrunk_mean(counts: Floats, members: npt.NDArray[np.bool_]) -> Floats:
    """Return the mean count per category of some rooms, with one average room added to them."""
    return np.asarray((counts[members].sum(axis=0) + counts.mean(axis=0)) / (members.sum() + 1))


# Spread: of rooms, of buildings, of categories


@dataclass(frozen=True, slots=True)
class Sizes:
    """Variances of the factors that many categories share; `structure` `[C + 1]` marks walls etc.

    Attributes:
        richness: of a building's furnishing and of its structure.
        rooms: of the room's size per type `[K]`.
        growth: how much of the room's size its structure follows, 0 to 1.
        structure: the categories that are structure.
    """

    richness: tuple[float, float]
    rooms: Floats
    growth: float
    structure: npt.NDArray[np.bool_]

    def follow(self) -> Floats:
        """Return how much of the room's size each category follows `[C + 1]`."""
        return np.where(self.structure, self.growth, 1.0)


def fit_sizes(data: Counts, means: Floats, assigned: Ints) -> Sizes:
    """Fit the factors that many categories share.

    All are moments of products of *different* categories, which the spread of one category does
    not enter: in different rooms of a building (richness), in the same room (size and richness).
    """
    flags = [STRUCTURE.match(name) is not None for name in data.categories] + [False]
    structure = np.array(flags)
    pair = data.matrix - means, means
    richness = []
    for chosen in (~structure, structure):
        across = []
        for values in (part[:, chosen] for part in pair):
            within = np.bincount(data.building, weights=_cross(values))
            across.append(float((_cross(sum_by_building(values, data.building)) - within).sum()))
        richness.append(max(across[0] / across[1], 0.01))
    rooms = [_cross(part[:, ~structure]) for part in pair]
    both = rooms[0].sum() / rooms[1].sum()
    mixed = [part[:, structure].sum(axis=1) * part[:, ~structure].sum(axis=1) for part in pair]
    growth = float(np.clip(mixed[0].sum() / mixed[1].sum() / both, 0, 1))
    types = int(assigned.max()) + 1
    prior = 0.2 * rooms[1].sum() / types
    top, bottom = (np.bincount(assigned, weights=part, minlength=types) for part in rooms)
    ratio = (top + prior * both) / (bottom + prior)
    sizes = np.maximum((1 + ratio) / (1 + richness[0]) - 1, 0.01)
    return Sizes((richness[0], richness[1]), sizes, growth, structure)


def _cross(values: Floats) -> Floats:
    """Sum the products of different categories in each row: `[N, C]` to `[N]`."""
    return np.asarray(values.sum(axis=1) ** 2 - (values**2).sum(axis=1))


def fit_spread(data: Counts, means: Floats) -> tuple[Floats, Floats]:
    """Return the variances, per category, of the building's style and of the room's burst `[C]`.

    Maximum likelihood on a grid: given the style, counts are negative binomial and independent.
    """
    grid = np.array([0.02, 0.05, 0.1, 0.2, 0.35, 0.6, 1, 1.5, 2.2, 3.3, 5, 8, 14, 25, 50])
    found = []
    for column in range(len(data.categories) + 1):
        y, mean = data.matrix[:, column], means[:, column]
        score = np.empty((len(grid), len(grid)))
        for i, variance in enumerate(grid):
            styles, weights = _gamma_nodes(float(variance))
            for j, burst in enumerate(1 / grid):
                one = _negative_binomial(y[:, None], mean[:, None] * styles, float(burst))
                building = sum_by_building(one, data.building) + np.log(weights)
                score[i, j] = np.logaddexp.reduce(building, axis=1).sum()
        best = np.unravel_index(int(score.argmax()), score.shape)
        found.append(grid[list(best)])
    style, burst = np.array(found).T
    return style, burst


def _gamma_nodes(variance: float) -> tuple[Floats, Floats]:
    """Return nodes and weights of a gamma variable of mean 1: means of intervals, finer on top."""
    above = np.array([1, 0.8, 0.6, 0.4, 0.25, 0.15, 0.08, 0.04, 0.02, 0.01, 0.004, 0])
    cuts = gamma.ppf(1 - above, 1 / variance, scale=variance)
    weights = -np.diff(above)
    nodes = np.diff(gamma.cdf(cuts, 1 / variance + 1, scale=variance)) / weights
    return np.maximum(nodes, 1e-9), weights


def _negative_binomial(y: Floats, mean: Floats, burst: float) -> Floats:
    """Return log likelihoods, with the part of the constant that depends on the shape."""
    ratio = mean / burst
    constant = gammaln(y + burst) - gammaln(burst)
    return np.asarray(constant + y * np.log(ratio) - (y + burst) * np.log1p(ratio))


def fit_regularity(
    data: Counts, means: Floats, grown: Floats, follow: Floats, spread: tuple[Floats, Floats]
) -> Floats:
    """Return the share of each category's mean that does not vary `[C + 1]`.

    A room has one floor, one ceiling, a bathroom one toilet: a Poisson count would leave too many
    rooms without. The share is the one with which simulated rooms hold the category as often as
    real ones do.

    Args:
        data: the real counts.
        means: the mean counts of each room's type `[R, C + 1]`.
        grown: the variance of each room's size `[R]`.
        follow: how much of the room's size each category follows `[C + 1]`.
        spread: the variances of style and burst `[C + 1]`.
    """
    style, burst = spread
    rng = np.random.default_rng(0)
    real = (data.matrix > 0).mean(axis=0)
    shares = np.linspace(0, 1, 6)
    held = np.zeros((len(shares), len(real)))
    for _ in range(10):
        scale = rng.gamma(1 / style, style, (int(data.building.max()) + 1, len(real)))
        size = rng.gamma(1 / grown, grown)[:, None]
        scale = scale[data.building] * (1 + follow * (size - 1))
        scale *= rng.gamma(1 / burst, burst, means.shape)
        for i, share in enumerate(shares):
            fixed = np.floor(share * means + rng.random(means.shape)) >= 1
            rest = rng.random(means.shape) >= np.exp(-(1 - share) * means * scale)
            held[i] += (fixed | rest).mean(axis=0) / 10
    held = np.maximum.accumulate(held, axis=0)
    found = [np.interp(p, held[:, c], shares) for c, p in enumerate(real)]
    return np.where(real > held[0] + 0.002, found, 0.0)


# Buildings, spellings, irregularities


def fit_composition(data: Counts, assigned: Ints) -> tuple[list[float], list[object]]:
    """Return the weight of each number of rooms, and the counts of each type per size of building.

    Both are smoothed: the first by a triangle of neighbours, the second towards a Poisson.
    """
    rooms = np.bincount(data.building)
    histogram = np.bincount(rooms, minlength=rooms.max() + 3).astype(float)
    smooth = np.convolve(histogram, [1, 2, 3, 2, 1], mode="same") / 9 / len(rooms)
    smooth[: rooms.min()] = 0
    types = int(assigned.max()) + 1
    each = np.zeros((len(rooms), types), dtype=np.int64)
    np.add.at(each, (data.building, assigned), 1)
    last = [int(np.quantile(rooms, q)) for q in (0.25, 0.5, 0.75)] + [len(smooth) - 1]
    bins: list[object] = []
    for low, high in itertools.pairwise([0, *last]):
        members = each[(rooms > low) & (rooms <= high)]
        most = int(members.max()) + 3
        prior = poisson.pmf(np.arange(most), members.mean(axis=0)[:, None])
        seen = np.stack([np.bincount(column, minlength=most) for column in members.T])
        weights = (seen + 3 * prior) / (len(members) + 3)
        bins.append([high, [_trimmed(row) for row in weights]])
    return _rounded(smooth), bins


def _trimmed(weights: Floats) -> list[float]:
    """Round weights and drop the trailing ones below a thousandth."""
    last = int(np.flatnonzero(weights >= 0.001)[-1])
    return _rounded(weights[: last + 1], digits=3)


def _rounded(values: Iterable[float], digits: int = 3) -> list[float]:
    """Round to significant digits; whole numbers become integers, which are shorter in JSON."""
    short = [float(f"{value:.{digits}g}") for value in values]
    return [int(value) if value == int(value) else value for value in short]


def fit_spellings(
    instances: Sequence[Instance], kept: Sequence[str]
) -> tuple[list[list[tuple[str, float]]], float]:
    """Return the raw spellings of each category and their shares, and their novelty.

    The spellings of a category that are found in fewer than MIN_SCENES scenes have one share
    together, in equal parts. The novelty is that of the urn with which two instances of a building
    agree as often as they do in fact.
    """
    counts: defaultdict[str, Counter[str]] = defaultdict(Counter)
    local: defaultdict[tuple[str, str], Counter[str]] = defaultdict(Counter)
    scenes: defaultdict[tuple[str, str], set[str]] = defaultdict(set)
    for one in instances:
        counts[one.category][one.raw] += 1
        local[one.scene, one.category][one.raw] += 1
        scenes[one.category, one.raw].add(one.scene)
    table: list[list[tuple[str, float]]] = []
    for category in kept:
        seen = counts[category]
        rare = [raw for raw in seen if len(scenes[category, raw]) < MIN_SCENES]
        pooled = sum(seen[raw] for raw in rare) / max(len(rare), 1)
        shares = {raw: (pooled if raw in rare else seen[raw]) / seen.total() for raw in seen}
        ordered = sorted(shares.items(), key=lambda item: (-item[1], item[0]))
        table.append([(raw, _rounded([share])[0]) for raw, share in ordered])
        if category in CHOSEN_SPELLINGS:
            table[-1].append(CHOSEN_SPELLINGS[category])
    within = expected = weight = 0.0
    for (_, category), names in local.items():
        total = names.total()
        if total > 1 and len(counts[category]) > 1:
            weight += total
            within += sum(n * (n - 1) for n in names.values()) / (total - 1)
            share = counts[category].total()
            expected += total * sum((n / share) ** 2 for n in counts[category].values())
    return table, (weight - within) / (within - expected)


def fit_rare_novelty(instances: Sequence[Instance], kept: Sequence[str]) -> float:
    """Return the urn's novelty with which a building has as many distinct rare names as in fact."""
    per_scene: defaultdict[str, list[str]] = defaultdict(list)
    named = set(kept)
    for one in instances:
        if one.category not in named:
            per_scene[one.scene].append(one.category)
    distinct = sum(len(set(names)) for names in per_scene.values())
    grid = np.geomspace(0.5, 50, 200)
    drawn = [sum((a / (a + np.arange(len(n)))).sum() for n in per_scene.values()) for a in grid]
    return float(np.interp(distinct, drawn, grid))


def fit_irregularities(instances: Sequence[Instance]) -> dict[str, float]:
    """Return the rates of irregularities; the two that the public text cannot show are chosen."""
    count = starts = gaps = strays = rooms = 0
    scenes = itertools.groupby(instances, key=lambda one: one.scene)
    for _, group in scenes:
        count += 1
        regions = [one.region for one in group]
        present = set(regions)
        starts += min(present) == 1
        gaps += max(present) - min(present) >= len(present)
        strays += sum(a != b for a, b in itertools.pairwise(regions)) + 1 - len(present)
        rooms += len(present)
    return {
        "starts_at_one": round(starts / count, 3),
        "gap": round(gaps / count, 3),
        "stray": round(strays / 2 / rooms, 3),  # a stray cuts off itself, and cuts a room in two
        "shuffled": 0.05,
        "null_region": 0.1,
    }


def fit_order(instances: Sequence[Instance], kept: Sequence[str]) -> list[float]:
    """Return the mean place `[C + 1]` of a category in the list of its room, from 0 to 1."""
    rooms: defaultdict[tuple[str, int], list[str]] = defaultdict(list)
    places: defaultdict[str, list[float]] = defaultdict(list)
    for one in instances:
        rooms[one.scene, one.region].append(one.category)
    for names in rooms.values():
        for index, name in enumerate(names):
            places[name].append((index + 0.5) / len(names))
    return [round(float(np.mean(places[name])), 2) for name in kept] + [0.5]


def _without(variance: Floats, part: Floats) -> Floats:
    """Divide a factor out of a product of independent factors of mean 1, in variances."""
    return np.asarray(np.maximum((1 + variance) / (1 + part) - 1, 0.01))


def fit(instances: Sequence[Instance]) -> dict[str, object]:
    """Fit everything that `bsg_data/synthetic/rates.json` holds."""
    data = count_rooms(instances)
    rates, assigned, scores = choose_types(data)
    means = rates[assigned]
    sizes = fit_sizes(data, means, assigned)
    style, burst = fit_spread(data, means)
    style = _without(style, np.where(sizes.structure, sizes.richness[1], sizes.richness[0]))
    grown, weight = sizes.rooms[assigned], means**2
    growth = (weight * np.outer(grown, sizes.follow() ** 2)).sum(axis=0) / weight.sum(axis=0)
    burst = _without(burst, growth)
    regular = fit_regularity(data, means, grown, sizes.follow(), (style, burst))
    small = 0.0005
    conserved = means.sum() / np.where(means < small, 0, means).sum()
    rates = np.where(rates < small, 0, rates) * conserved
    rooms, bins = fit_composition(data, assigned)
    spellings, novelty = fit_spellings(instances, data.categories)
    return {
        "about": "Aggregate rates of HM3D-Semantics v0.2 (train scenes of the public statistics) "
        "for synthetic buildings; made by scripts/fit/synthetic_rates.py, see docs/synthetic.md",
        "version": 1,
        "fitted_on": {
            "scenes": int(data.building.max()) + 1,
            "rooms": len(data.matrix),
            "instances": len(instances),
            "least_scenes_of_a_name": MIN_SCENES,
            "held_out_log_likelihood_per_room": scores,
        },
        "categories": list(data.categories),
        "order": fit_order(instances, data.categories),
        "regularity": _rounded(regular, digits=2),
        "style": _rounded(style, digits=2),
        "burst": _rounded(burst, digits=2),
        "structure": sizes.structure.astype(int).tolist(),
        "growth": float(f"{sizes.growth:.3g}"),
        "richness": _rounded(sizes.richness),
        "sizes": _rounded(sizes.rooms),
        "rates": [_rounded(row) for row in rates],
        "rooms": rooms,
        "bins": bins,
        "spellings": spellings,
        "novelty": [round(novelty, 2), round(fit_rare_novelty(instances, data.categories), 2)],
        **fit_irregularities(instances),
    }


def to_json(rates: dict[str, object]) -> str:
    """Write one field a line, and one item a line of a list of lists."""
    lines = []
    for key, value in rates.items():
        if isinstance(value, list) and isinstance(value[0], list):
            items = ",\n".join(_compact(item) for item in value)
            lines.append(f"{_compact(key)}:[\n{items}\n]")
        else:
            lines.append(f"{_compact(key)}:{_compact(value)}")
    return "{\n" + ",\n".join(lines) + "\n}\n"


def _compact(value: object) -> str:
    return json.dumps(value, separators=(",", ":"), ensure_ascii=False)


# How close


@dataclass(frozen=True, slots=True)
class Corpus:
    """What is compared: counts per room and category `[R, C]`, and figures per building `[B]`.

    Categories are in the order of their real totals. `odd` counts the instances that are not spelt
    as their category, `structure` those whose name starts with wall, floor, ceiling, door, ...;
    `unknown` is the column of that category.
    """

    counts: Floats
    building: Ints
    odd: Floats
    structure: Floats
    names: tuple[frozenset[str], ...]
    unknown: int

    def subset(self, chosen: Ints) -> Corpus:
        """Return some buildings, renumbered."""
        place = np.full(len(self.names), -1)
        place[chosen] = np.arange(len(chosen))
        rooms = place[self.building] >= 0
        return Corpus(
            self.counts[rooms],
            place[self.building[rooms]],
            self.odd[chosen],
            self.structure[chosen],
            tuple(self.names[int(index)] for index in chosen),
            self.unknown,
        )

    def totals(self) -> Floats:
        """Return the number of objects per building `[B]`."""
        return np.asarray(np.bincount(self.building, weights=self.counts.sum(axis=1)), float)

    def held(self) -> Floats:
        """Return the number of rooms that hold each category, per building `[B, C]`."""
        return sum_by_building((self.counts > 0).astype(float), self.building)


def build_corpus(
    rows: dict[tuple[str, int], tuple[str, int]], category_of: dict[str, str], order: Sequence[str]
) -> Corpus:
    """Gather annotation rows; the null region is left out."""
    kept = [(scene, name, region) for (scene, _), (name, region) in rows.items() if region >= 0]
    rooms = {key: index for index, key in enumerate(sorted({(s, r) for s, _, r in kept}))}
    scenes = {scene: index for index, scene in enumerate(sorted({s for s, _, _ in kept}))}
    column = {name: index for index, name in enumerate(order)}
    counts = np.zeros((len(rooms), len(order)))
    odd, structure = np.zeros(len(scenes)), np.zeros(len(scenes))
    names: list[set[str]] = [set() for _ in scenes]
    for scene, name, region in kept:
        counts[rooms[scene, region], column[category_of[name]]] += 1
        odd[scenes[scene]] += name != category_of[name]
        structure[scenes[scene]] += STRUCTURE.match(name) is not None
        names[scenes[scene]].add(name)
    building = np.array([scenes[scene] for scene, _ in rooms])
    return Corpus(counts, building, odd, structure, tuple(map(frozenset, names)), column["unknown"])


def samples(corpus: Corpus) -> dict[str, Floats]:
    """Return the statistics that have one value per building or room."""
    totals = corpus.totals()
    unknown = np.bincount(corpus.building, weights=corpus.counts[:, corpus.unknown])
    return {
        "rooms per building": np.bincount(corpus.building).astype(float),
        "objects per building": totals,
        "objects per room": corpus.counts.sum(axis=1),
        "categories per room": (corpus.counts > 0).sum(axis=1).astype(float),
        "raw names per building": np.array([len(names) for names in corpus.names], dtype=float),
        "structure, % of a building's objects": 100 * corpus.structure / totals,
        "`unknown`, % of a building's objects": 100 * unknown / totals,
        "odd spellings, % of a building's objects": 100 * corpus.odd / totals,
    }


def _correlation(values: Floats) -> Floats:
    """Return Pearson correlations `[C, C]`; a constant column has none."""
    centred = values - values.mean(axis=0)
    norm = np.sqrt((centred**2).sum(axis=0))
    unit = np.divide(centred, norm, out=np.zeros_like(centred), where=norm > 0)
    return np.asarray(unit.T @ unit)


def _shares(corpus: Corpus) -> Floats:
    return np.asarray(corpus.counts.sum(axis=0) / corpus.counts.sum())


def distances(one: Corpus, other: Corpus) -> dict[str, float]:
    """Return every distance between two corpora."""
    result = {
        f"{name}: Wasserstein": float(wasserstein_distance(values, samples(other)[name]))
        for name, values in samples(one).items()
    }
    top, pair = slice(0, 50), (one, other)
    shares = [_shares(c) for c in pair]
    rooms = [(c.counts > 0).mean(axis=0) for c in pair]
    buildings = [(c.held() > 0).mean(axis=0) for c in pair]
    in_rooms = [_correlation((c.counts[:, top] > 0).astype(float)) for c in pair]
    in_buildings = [_correlation(np.log1p(c.held()[:, top])) for c in pair]
    spread = [
        wasserstein_distance(one.counts[:, c], other.counts[:, c]) / one.counts[:, c].mean()
        for c in range(50)
    ]
    many = [wasserstein_distance(one.held()[:, c], other.held()[:, c]) for c in range(50)]
    return result | {
        "share of each category: total variation": float(abs(shares[0] - shares[1]).sum() / 2),
        "presence in rooms, top 50: mean difference": float(abs(rooms[0] - rooms[1])[top].mean()),
        "presence in rooms, top 50: largest": float(abs(rooms[0] - rooms[1])[top].max()),
        "presence in buildings, top 200: mean difference": float(
            abs(buildings[0] - buildings[1])[:200].mean()
        ),
        "count in a room / its mean, top 50: Wasserstein": float(np.mean(spread)),
        "rooms of a building with it, top 50: Wasserstein": float(np.mean(many)),
        "correlation of presence in rooms, top 50: Frobenius": float(
            np.linalg.norm(in_rooms[0] - in_rooms[1])
        ),
        "correlation over buildings, top 50: Frobenius": float(
            np.linalg.norm(in_buildings[0] - in_buildings[1])
        ),
    }


def compare(instances: Sequence[Instance], folder: Path) -> str:
    """Return the tables of docs/results/synthetic.md for a folder of synthetic buildings."""
    votes: defaultdict[str, Counter[str]] = defaultdict(Counter)
    for one in instances:
        votes[one.raw][one.category] += 1
    category_of = {raw: counter.most_common(1)[0][0] for raw, counter in votes.items()}
    totals = Counter(category_of[one.raw] for one in instances)
    named = set(count_rooms(instances).categories)  # the rare ones go last
    order = sorted(totals, key=lambda name: (name not in named, -totals[name], name))
    rows = {(one.scene, one.number): (one.raw, one.region) for one in instances}
    real = build_corpus(rows, category_of, order)
    made = build_corpus(read_annotations(folder), category_of, order)
    size = len(real.names)
    if len(made.names) < size:
        raise SystemExit(f"{folder}: {len(made.names)} buildings; write at least {size}")
    made = made.subset(np.arange(size))
    return "\n".join(
        [
            *_value_table(real, made),
            "",
            *_distance_table(real, made),
            "",
            *_category_table(real, made, order),
        ]
    )


def _value_table(real: Corpus, made: Corpus) -> list[str]:
    lines = ["| statistic | | real | synthetic |", "|---|---|---:|---:|"]
    quantiles = (5, 25, 50, 75, 95, 99)
    for name, values in samples(real).items():
        other = samples(made)[name]
        lines.append(f"| {name} | mean | {values.mean():.1f} | {other.mean():.1f} |")
        lines.append(f"| | standard deviation | {values.std():.1f} | {other.std():.1f} |")
        both = [
            " / ".join(f"{q:.4g}" for q in np.round(np.percentile(v, quantiles), 1))
            for v in (values, other)
        ]
        lines.append(f"| | quantiles {' / '.join(map(str, quantiles))} % | {both[0]} | {both[1]} |")
    distinct = [len(frozenset().union(*corpus.names)) for corpus in (real, made)]
    lines.append(f"| raw names in all buildings | number | {distinct[0]} | {distinct[1]} |")
    return lines


def _distance_table(real: Corpus, made: Corpus) -> list[str]:
    """Compare a half of the real buildings with as many synthetic ones, and with its other half."""
    rng = np.random.default_rng(0)
    half = len(real.names) // 2
    found: defaultdict[str, list[tuple[float, float]]] = defaultdict(list)
    for _ in range(SPLITS):
        mixed = rng.permutation(len(real.names))
        one, other = real.subset(mixed[:half]), real.subset(mixed[half : 2 * half])
        some = made.subset(rng.permutation(len(made.names))[:half])
        floor = distances(one, other)
        for name, value in distances(one, some).items():
            found[name].append((value, floor[name]))
    lines = ["| distance | real to synthetic | real to real | ratio |", "|---|---:|---:|---:|"]
    for name, values in found.items():
        ours, floor_ = np.mean(values, axis=0)
        lines.append(f"| {name} | {ours:.3g} | {floor_:.3g} | {ours / floor_:.2f} |")
    return lines


def _category_table(real: Corpus, made: Corpus, order: Sequence[str]) -> list[str]:
    lines = [
        "| category | per room, real | synthetic | % of rooms with it, real | synthetic |",
        "|---|---:|---:|---:|---:|",
    ]
    for index, name in enumerate(order[:20]):
        pair = [corpus.counts[:, index] for corpus in (real, made)]
        counts = " | ".join(f"{values.mean():.2f}" for values in pair)
        presence = " | ".join(f"{100 * (values > 0).mean():.1f}" for values in pair)
        lines.append(f"| {name} | {counts} | {presence} |")
    return lines


def main() -> None:
    """Fit, or compare."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--hm3d-stats", type=Path, required=True, help="the public statistics, zip")
    parser.add_argument("--annotations", type=Path, required=True, help="folder of semantic.txt")
    action = parser.add_mutually_exclusive_group(required=True)
    action.add_argument("--out", type=Path, help="where to write the rates (JSON)")
    action.add_argument("--compare", type=Path, help="folder written by bsg-data synth")
    options = parser.parse_args()
    instances = read_instances(options.hm3d_stats, options.annotations)
    if options.compare:
        print(compare(instances, options.compare))
    else:
        options.out.write_text(to_json(fit(instances)), encoding="utf-8")
        print(f"{options.out}: {options.out.stat().st_size} bytes")


if __name__ == "__main__":
    main()
