"""Fit the weights of bsg_data/passages.py on real room layouts, and cross-validate them.

    python scripts/fit/passages.py --layouts PATH/TO/room_layouts

The layouts are DomestiGraph's YAML. Ten folds over buildings, five ways to fold: weights and
thresholds come from the training folds alone. Prints the plain rule beside it, the cross-validated
figures with what each part is worth, those by kind of pair and of every building, and the constants
to put into passages.py. Takes about a minute.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.optimize import minimize

from bsg_data.geometry import passages
from bsg_data.sources.room_layouts import read_layout

Floats = npt.NDArray[np.float64]
RIDGE, RIDGE_BIAS, RIDGE_OUTPUT = 1.0, 0.3, 5.0
FOLDS, SEEDS = 10, 5
TREES_THRESHOLD = 0.38  # best for them in hindsight, which flatters the trees


@dataclass(frozen=True)
class Building:
    """One layout: its near pairs with their features, and which of them connect."""

    name: str
    boxes: Floats
    pairs: npt.NDArray[np.int64]
    features: Floats  # [2, P, F]
    truth: Floats  # [P], 1 where connected
    connections: int  # near or not


@dataclass(frozen=True)
class Fit:
    """Weights of the features `[F]`, and how shares become probabilities."""

    weights: Floats
    bias: float
    slope: float
    shift: float
    forest: bool = True

    def predict(self, building: Building) -> Floats:
        """Return the probability of every pair `[P]`."""
        if not len(building.pairs):
            return np.zeros(0)
        log_weight = building.features @ self.weights + self.bias
        rooms = len(building.boxes)
        if self.forest:
            share = passages.share_of_forests(building.pairs, log_weight, rooms=rooms)
        else:
            share = 1 - (1 / (1 + np.exp(log_weight))).prod(axis=0)
        return passages.to_probability(share, self.slope, self.shift)


def read_buildings(folder: Path) -> list[Building]:
    """Read every layout of a folder."""
    found = []
    for path in sorted(folder.glob("*.yaml")):
        layout = read_layout(path)
        numbers = sorted(layout.rooms)
        boxes = np.array([[b.minimum, b.maximum] for _, b in (layout.rooms[n] for n in numbers)])
        place = {number: i for i, number in enumerate(numbers)}
        connected = {(place[a], place[b]) for a, b in layout.connections}
        pairs, features = passages.describe_pairs(boxes)
        stacked = np.stack([features[name] for name in passages.WEIGHTS], axis=-1)
        truth = np.array([tuple(pair) in connected for pair in pairs.tolist()], dtype=float)
        found.append(Building(path.stem, boxes, pairs, stacked, truth, len(connected)))
    return found


def fit(buildings: Sequence[Building], *, forest: bool = True) -> Fit:
    """Fit by ridge maximum likelihood of the pairs.

    Args:
        buildings: to fit on.
        forest: through the shares of forests; otherwise each pair for itself, which connects if
            either way round does.
    """
    stacked = np.concatenate([b.features.reshape(-1, b.features.shape[-1]) for b in buildings])
    mean, spread = stacked.mean(axis=0), stacked.std(axis=0) + 1e-9

    def cost(theta: Floats) -> tuple[float, Floats]:
        weights, bias, (slope, shift) = theta[:-3], theta[-3], theta[-2:]
        loss = 0.5 * (RIDGE * weights @ weights + RIDGE_BIAS * bias**2)
        loss += 0.5 * RIDGE_OUTPUT * ((slope - 1) ** 2 + shift**2)
        gradient = np.concatenate(
            [RIDGE * weights, [RIDGE_BIAS * bias, RIDGE_OUTPUT * (slope - 1), RIDGE_OUTPUT * shift]]
        )
        for building in buildings:
            more, step = _cost_of_one(building, theta, mean, spread, forest=forest)
            loss, gradient = loss + more, gradient + step
        return float(loss), gradient

    start = np.zeros(stacked.shape[1] + 3)
    start[-2] = 1.0
    theta = minimize(cost, start, jac=True, method="L-BFGS-B", options={"maxiter": 300}).x
    weights = theta[:-3] / spread
    bias = float(theta[-3] - mean @ weights)
    return Fit(weights, bias, float(theta[-2]), float(theta[-1]), forest)


def _cost_of_one(
    building: Building, theta: Floats, mean: Floats, spread: Floats, *, forest: bool
) -> tuple[float, Floats]:
    """Return the negative log-likelihood of a building's pairs and its gradient.

    With K the inverse of I + Laplacian, the share of child → parent is w (K_cc - K_pc), and
    dK = -K dL K.
    """
    if not len(building.pairs):
        return 0.0, np.zeros_like(theta)
    scaled = (building.features - mean) / spread
    raw = (scaled @ theta[:-3] + theta[-3]).ravel()
    weight = np.exp(np.clip(raw, -15, 15))
    child = building.pairs.T.ravel()
    parent = building.pairs[:, ::-1].T.ravel()
    if forest:
        laplacian = np.eye(len(building.boxes))
        np.add.at(laplacian, (child, child), weight)
        np.add.at(laplacian, (child, parent), -weight)
        inverse = np.linalg.inv(laplacian)
        reached = inverse[child, child] - inverse[parent, child]
        share = (weight * reached).reshape(2, -1).sum(axis=0)
    else:
        share = 1 - (1 / (1 + weight)).reshape(2, -1).prod(axis=0)
    inside = np.clip(share, 1e-5, 1 - 1e-5)
    logit = np.log(inside / (1 - inside))
    belief = 1 / (1 + np.exp(-(theta[-2] * logit + theta[-1])))
    truth = building.truth
    loss = -(truth * np.log(belief + 1e-12) + (1 - truth) * np.log(1 - belief + 1e-12)).sum()
    off = belief - truth
    of_share = np.tile(off * theta[-2] / (inside * (1 - inside)) * (share == inside), 2)
    if forest:
        of_inverse = np.zeros_like(inverse)
        np.add.at(of_inverse, (child, child), of_share * weight)
        np.add.at(of_inverse, (parent, child), -of_share * weight)
        of_laplacian = -inverse.T @ of_inverse @ inverse.T
        of_raw = of_share * reached + of_laplacian[child, child] - of_laplacian[child, parent]
        of_raw *= weight
    else:
        of_raw = of_share * np.tile(1 - share, 2) * weight / (1 + weight)
    of_raw *= np.abs(raw) < 15
    flat = scaled.reshape(-1, scaled.shape[-1])
    return float(loss), np.concatenate(
        [flat.T @ of_raw, [of_raw.sum(), (off * logit).sum(), off.sum()]]
    )


def best_threshold(buildings: Sequence[Building], beliefs: Sequence[Floats]) -> float:
    """Return the probability from which on to connect, by pooled F1 smoothed over 15 pairs."""
    belief = np.concatenate(beliefs)
    truth = np.concatenate([building.truth for building in buildings])
    order = np.argsort(-belief, kind="stable")
    total = sum(building.connections for building in buildings)
    f1 = 2 * np.cumsum(truth[order]) / (np.arange(1, len(order) + 1) + total)
    smooth = np.convolve(f1, np.ones(15) / 15, "same")
    return float(belief[order[smooth[10:-10].argmax() + 10]])


def figures(buildings: Sequence[Building], kept: Sequence[npt.NDArray[np.bool_]]) -> Floats:
    """Return pooled precision, recall and F1, and the mean F1 of buildings."""
    right = np.array([(k * b.truth).sum() for b, k in zip(buildings, kept, strict=True)])
    found = np.array([k.sum() for k in kept])
    true = np.array([building.connections for building in buildings])
    precision = right.sum() / max(found.sum(), 1)
    recall = right.sum() / max(true.sum(), 1)
    each = 2 * right / np.maximum(found + true, 1)
    return np.array([precision, recall, 2 * right.sum() / (found + true).sum(), each.mean()])


def cross_validate(
    buildings: Sequence[Building], seed: int, *, folds: int = FOLDS, forest: bool = True
) -> list[npt.NDArray[np.bool_]]:
    """Return which pairs of each building connect, by a fit that has not seen it."""
    kept: list[npt.NDArray[np.bool_]] = [np.zeros(0, dtype=bool)] * len(buildings)
    order = np.random.default_rng(seed).permutation(len(buildings))
    for fold in np.array_split(order, folds):
        training = [b for i, b in enumerate(buildings) if i not in set(fold.tolist())]
        found = fit(training, forest=forest)
        threshold = best_threshold(training, [found.predict(b) for b in training])
        for i in fold:
            building = buildings[i]
            belief = found.predict(building)
            kept[i] = passages.choose_pairs(
                building.pairs, belief, rooms=len(building.boxes), threshold=threshold
            )
    return kept


def boosted_trees(buildings: Sequence[Building], seed: int) -> list[npt.NDArray[np.bool_]]:
    """Return the same by LightGBM on the same features, both ways round in either order."""
    import lightgbm

    kept: list[npt.NDArray[np.bool_]] = [np.zeros(0, dtype=bool)] * len(buildings)
    columns = [
        np.concatenate([b.features.mean(axis=0), b.features.max(axis=0)], axis=1) for b in buildings
    ]
    order = np.random.default_rng(seed).permutation(len(buildings))
    settings = {"objective": "binary", "num_leaves": 7, "learning_rate": 0.05, "verbose": -1}
    for fold in np.array_split(order, FOLDS):
        rest = [i for i in range(len(buildings)) if i not in set(fold.tolist())]
        truth = np.concatenate([buildings[i].truth for i in rest])
        data = lightgbm.Dataset(np.concatenate([columns[i] for i in rest]), truth)
        trees = lightgbm.train({**settings, "seed": seed, "num_threads": 1}, data, 150)
        for i in fold:
            kept[i] = trees.predict(columns[i]) >= TREES_THRESHOLD if len(columns[i]) else kept[i]
    return kept


def without(buildings: Sequence[Building], *names: str) -> list[Building]:
    """Return the buildings with some features made 0."""
    keep = np.array([name not in names for name in passages.WEIGHTS], dtype=float)
    return [replace(building, features=building.features * keep) for building in buildings]


def kinds_of(building: Building) -> npt.NDArray[np.str_]:
    """Return the kind of every near pair `[P]`."""
    low, high = building.boxes[:, 0], building.boxes[:, 1]
    a, b = building.pairs.T
    gap = (np.maximum(low[a], low[b]) - np.minimum(high[a], high[b]))[:, :2].max(axis=1)
    step = np.abs(low[a, 2] - low[b, 2])
    level = np.where(gap < 0, "one level, boxes overlap", "one level, a wall between")
    return np.where(step < 1, level, np.where(step < 2, "a step of 1 to 2 m", "over stairs"))


def plain_rule(building: Building) -> npt.NDArray[np.bool_]:
    """Connect rooms with a gap below 0.15 m whose floors differ by less than 1.5 m."""
    low, high = building.boxes[:, 0], building.boxes[:, 1]
    a, b = building.pairs.T
    gap = (np.maximum(low[a], low[b]) - np.minimum(high[a], high[b]))[:, :2].max(axis=1)
    return (gap < 0.15) & (np.abs(low[a, 2] - low[b, 2]) < 1.5)


def main() -> None:
    """Print everything."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--layouts", type=Path, required=True)
    buildings = read_buildings(parser.parse_args().layouts)
    rooms = sum(len(building.boxes) for building in buildings)
    pairs, reach = sum(b.connections for b in buildings), sum(b.truth.sum() for b in buildings)
    print(f"{len(buildings)} buildings, {rooms} rooms, {pairs} connections, {reach:.0f} near")
    header = "precision  recall  F1     mean F1 of buildings"
    print(f"\n{'':45s}{header}")
    row = figures(buildings, [plain_rule(building) for building in buildings])
    print(f"{'plain rule':45s}" + "      ".join(f"{v:.3f}" for v in row))
    walls = without(buildings, "gap_over_6cm", "thick_wall")
    ways: dict[str, Callable[[int], list[npt.NDArray[np.bool_]]]] = {
        "boosted trees, same features": lambda seed: boosted_trees(buildings, seed),
        "each pair for itself": lambda seed: cross_validate(buildings, seed, forest=False),
        "forest, without thickness of walls": lambda seed: cross_validate(walls, seed),
        "forest, trained on half": lambda seed: cross_validate(buildings, seed, folds=2),
        "forest": lambda seed: cross_validate(buildings, seed),
    }
    for what, way in ways.items():
        runs = [way(seed) for seed in range(SEEDS)]
        scores = np.array([figures(buildings, kept) for kept in runs])
        line = "      ".join(f"{v:.3f}" for v in scores.mean(axis=0))
        print(f"{what:45s}{line}      deviation of F1 {scores[:, 2].std():.3f}")
    kinds = np.concatenate([kinds_of(building) for building in buildings])
    truth = np.concatenate([building.truth for building in buildings])
    kept_all = np.mean([np.concatenate(kept) for kept in runs], axis=0)
    print(f"\n{'near pairs by kind':45s}true   F1")
    for kind in np.unique(kinds):
        here = kinds == kind
        right = (kept_all * truth)[here].sum()
        f1 = 2 * right / (kept_all[here].sum() + truth[here].sum())
        print(f"{kind:45s}{truth[here].sum():4.0f}   {f1:.2f}")
    print(f"\n{'building':24s}precision  recall  F1, mean over the foldings")
    for number, building in enumerate(buildings):
        each = np.mean([figures([building], [kept[number]])[:3] for kept in runs], axis=0)
        print(f"{building.name:24s}" + "      ".join(f"{v:.2f}" for v in each))
    found = fit(buildings)
    threshold = best_threshold(buildings, [found.predict(building) for building in buildings])
    print("\nfitted on all; for bsg_data/passages.py:")
    for name, weight in zip(passages.WEIGHTS, found.weights, strict=True):
        print(f'        "{name}": {weight:.3g},')
    print(f"BIAS = {found.bias:.3g}\nSLOPE, SHIFT = {found.slope:.3g}, {found.shift:.3g}")
    print(f"THRESHOLD = {threshold:.3g}")


if __name__ == "__main__":
    main()
