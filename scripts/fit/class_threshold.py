"""Measure in how many buildings a class must stand to be learned: the threshold of hm3d-wide-v1.

    python scripts/fit/class_threshold.py --hm3d-stats PATH/TO/HM3DSem-v0.2.zip

Half of the objects of every room are hidden. From the classes that are seen, naive Bayes ranks the
rooms of held-out buildings by whether they hide an object of an unseen class (five folds over
buildings, five draws). Prints the AUROC by the number of buildings that hold the class, for the
classes of hm3d-wide-v1 with the candidates that it does not have, and for every name of HM3D as a
class of its own; then how many classes each threshold keeps. Takes about fifteen seconds.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.stats import rankdata

from bsg_data.scene.class_map import ClassMap, load_class_map
from bsg_data.sources.hm3d_stats import HM3DStatistics

Floats = npt.NDArray[np.float64]
WIDE = "hm3d-wide-v1"
FOLDS, DRAWS = 5, 5
SMOOTHING = 10.0  # rooms: a rare class has few of its own, and leans on all rooms
CHANCE = 0.6  # an AUROC below it is hardly better than chance
BINS = (
    (3, 5),
    (6, 7),
    (8, 9),
    (10, 11),
    (12, 14),
    (15, 19),
    (20, 29),
    (30, 49),
    (50, 79),
    (80, 145),
)
# What was considered for a class and stands in fewer than ten buildings: its names.
CANDIDATES = {
    "amplifier": ("amplifier",),
    "beanbag": ("beanbag", "beanbag chair", "bean bag chair"),
    "bicycle": ("bicycle",),
    "board game": ("board game", "board games", "chess", "game board", "game"),
    "crib": ("crib", "cradle"),
    "cross": ("cross", "holy cross"),
    "disc": ("cd", "cds", "dvd", "stack of cds", "records", "vinyl records"),
    "doll": ("doll", "puppet", "ragdoll", "ragdoll cat"),
    "exercise mat": ("exercise mat", "exercise mat roll", "yoga mat", "gym mat", "training mat"),
    "flower stand": ("flower stand",),
    "grill": ("grill", "barbecue"),
    "hair dryer": ("hair dryer",),
    "headphones": ("headphones", "headset"),
    "iron": ("iron",),
    "jewelry box": ("jewelry box", "box with jewelry"),
    "keys": ("keys", "board with keys"),
    "mixer": ("mixer", "food processor"),
    "musical instrument": (
        *("drum", "electric drum", "electric percussion", "hi-hat", "clarinet", "saxophone"),
        *("tambourine", "trombone", "trumpet", "violin", "instrument"),
    ),
    "plunger": ("plunger",),
    "poster": ("poster",),
    "projector": ("projector",),
    "rope": ("rope",),
    "trophy": ("trophy", "medal", "medal collection"),
    "water dispenser": ("water dispenser", "beverage dispenser", "drinking fountain"),
    "wine bottle": ("wine bottle", "bottle of wine", "bottles of wine", "alcohol bottles"),
}
Objects = Sequence[tuple[str, int, str]]


def main() -> None:
    """Read the annotations, and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--hm3d-stats", type=Path, required=True, help="HM3DSem's zip")
    wide = load_class_map(WIDE)
    objects = read_objects(parser.parse_args().hm3d_stats, wide)
    classes = wide_classes(wide)
    print("classes of hm3d-wide-v1 and its candidates")
    print_auroc(objects, classes.get)
    print("every name a class")
    print_auroc(objects, lambda name: None if name in wide.structure else name)
    counted = count_buildings(objects, classes.get)
    print("buildings  classes")
    for threshold in (5, 6, 7, 8, 9, 10, 12, 15, 20):
        print(f"{threshold:9}  {sum(found >= threshold for found in counted.values()):7}")
    for name in sorted(CANDIDATES):
        print(f"{name}: {counted.get(name, 0)}")


def read_objects(path: Path, class_map: ClassMap) -> list[tuple[str, int, str]]:
    """Return scene, room and corrected name of every object of a room that has a name."""
    source = HM3DStatistics(path)
    return [
        (ref.scene_id, obj.room_index, obj.category)
        for ref in source.find().scenes
        for obj in source.read(ref, class_map).graph.objects
        if obj.room_index and obj.category and not obj.category.startswith("unknown")
    ]


def wide_classes(wide: ClassMap) -> dict[str, str]:
    """Return the class of every name, candidates taking theirs back."""
    indices = {e.category: e.class_index for e in wide.entries.values()}
    found = {name: wide.classes[i] for name, i in indices.items() if i is not None}
    return found | {name: new for new, names in CANDIDATES.items() for name in names}


def count_buildings(objects: Objects, class_of: Callable[[str], str | None]) -> Mapping[str, int]:
    """Return in how many buildings each class stands."""
    buildings: dict[str, set[str]] = {}
    for scene, _, name in objects:
        found = class_of(name)
        if found is not None:
            buildings.setdefault(found, set()).add(scene)
    return {name: len(scenes) for name, scenes in buildings.items()}


def print_auroc(objects: Objects, class_of: Callable[[str], str | None]) -> None:
    """Print the median AUROC, and the share near chance, by the number of buildings."""
    buildings = {n: b for n, b in count_buildings(objects, class_of).items() if b >= BINS[0][0]}
    rooms = sorted({(scene, room) for scene, room, _ in objects})
    row, column = {r: i for i, r in enumerate(rooms)}, {n: i for i, n in enumerate(buildings)}
    scenes = np.unique([scene for scene, _ in rooms], return_inverse=True)[1]
    found = [(row[s, r], column[c]) for s, r, n in objects if (c := class_of(n) or "") in column]
    places = np.array(found)
    scores = np.stack([draw_auroc(places, scenes, len(column), seed=s) for s in range(DRAWS)])
    held = np.array(list(buildings.values()))
    print("buildings  classes  median  quartile  below .6")
    for low, high in BINS:
        inside = scores[:, (held >= low) & (held <= high)]
        known = inside[~np.isnan(inside)]
        quartile, median = np.quantile(known, [0.25, 0.5]) if known.size else (np.nan, np.nan)
        share = np.mean(known < CHANCE) if known.size else np.nan
        print(
            f"{low:4}–{high:<4}  {inside.shape[1]:7}  {median:6.3f}  {quartile:8.3f}  {share:8.2f}"
        )


def draw_auroc(
    places: npt.NDArray[np.int64], scenes: npt.NDArray[np.int64], classes: int, *, seed: int
) -> Floats:
    """Return the AUROC of each unseen class `[C]`, from rooms of held-out buildings.

    Args:
        places: `[O, 2]` room and class of every object.
        scenes: `[R]` the building of every room.
        classes: C.
        seed: of what is hidden, and of the folds.
    """
    generator = np.random.default_rng(seed)
    seen, hidden = (np.zeros((len(scenes), classes), dtype=bool) for _ in range(2))
    visible = generator.random(len(places)) < 1 / 2
    seen[tuple(places[visible].T)] = True
    hidden[tuple(places[~visible].T)] = True
    fold = generator.permutation(scenes.max() + 1)[scenes] % FOLDS
    score = np.zeros(seen.shape)
    for k in range(FOLDS):
        score[fold == k] = rank_rooms(seen[fold != k], hidden[fold != k], seen[fold == k])
    unseen = (~seen[:, c] for c in range(classes))
    return np.array([auroc(hidden[m, c], score[m, c]) for c, m in enumerate(unseen)])


def rank_rooms(
    seen: npt.NDArray[np.bool_], hidden: npt.NDArray[np.bool_], asked: npt.NDArray[np.bool_]
) -> Floats:
    """Return the log odds `[Q, C]` of each class in the rooms that are asked, by naive Bayes."""
    with_class, rooms = hidden.sum(0).astype(float), len(hidden)
    odds = np.log((with_class + 0.5) / (rooms - with_class + 0.5)) + np.zeros((len(asked), 1))
    for sign, member in ((1, hidden), (-1, ~hidden)):
        together = member.T.astype(float) @ seen
        share = together + SMOOTHING * seen.mean(0)
        share = np.clip(share / (member.sum(0)[:, None] + SMOOTHING), 1e-4, 1 - 1e-4)
        odds += sign * (asked @ np.log(share).T + ~asked @ np.log1p(-share).T)
    return np.asarray(odds, dtype=np.float64)


def auroc(present: npt.NDArray[np.bool_], score: Floats) -> float:
    """Return the share of pairs, one room with and one without, in the right order."""
    positive, negative = int(present.sum()), int((~present).sum())
    if not positive or not negative:
        return float("nan")
    below = rankdata(score)[present].sum() - positive * (positive + 1) / 2
    return float(below / (positive * negative))


if __name__ == "__main__":
    main()
