"""Cells that wait in files, against the ranking of all of them in memory."""

from __future__ import annotations

import numpy as np
import pytest

from bsg_models.evaluation import metrics, ranked_cells
from bsg_models.evaluation.presence import SELECTIONS, PresenceCells
from bsg_models.evaluation.ranked_cells import RankedCells

ROOMS, CLASSES = 60, 4
WEIGHTS = np.random.default_rng(1).integers(0, 3, (7, 3)).astype(np.uint16)


def fill(digits: int) -> tuple[RankedCells, PresenceCells, np.ndarray]:
    """Return the same cells both ways, in three batches; few digits make many ties."""
    rng = np.random.default_rng(0)
    shape = (ROOMS, CLASSES)
    nodes = {
        "presence": rng.random(shape).round(digits),
        "seen": rng.random(shape) < 0.4,
        "hidden": rng.random(shape) < 0.3,
        "visited": rng.random(ROOMS) < 0.5,
    }
    building = rng.integers(0, len(WEIGHTS), ROOMS)
    cells = RankedCells(WEIGHTS)
    for rows in np.split(np.arange(ROOMS), [10, 10, 45]):
        cells.add_nodes(building=building[rows], **{k: v[rows] for k, v in nodes.items()})
    return cells, PresenceCells(**nodes), building


@pytest.mark.parametrize("digits", [1, 12])
@pytest.mark.parametrize(("held", "piece"), [(1 << 20, 1 << 20), (64, 16)])
def test_the_ranking_is_that_of_all_cells_in_memory(
    digits: int, held: int, piece: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ranked_cells, "HELD", held)
    monkeypatch.setattr(ranked_cells, "PIECE", piece)
    monkeypatch.setattr(ranked_cells, "_SAMPLED", 3)
    cells, expected, building = fill(digits)
    ranks = cells.ranks
    assert cells.rooms == expected.rooms
    for w in range(WEIGHTS.shape[1]):
        of_rooms = WEIGHTS[building, w].astype(float)
        for name in SELECTIONS:
            whole, parts = expected.together[name], expected.by_class[name]
            sums = whole.cumulate(whole.weigh(of_rooms))
            assert ranks.auroc[name][w] == pytest.approx(metrics.auroc_of_sums(*sums))
            found = ranks.precision[name][w]
            assert found == pytest.approx(metrics.average_precision_of_sums(*sums))
            for c, part in enumerate(parts):
                sums = part.cumulate(part.weigh(of_rooms))
                found = ranks.auroc_of_classes[name][c, w]
                assert found == pytest.approx(metrics.auroc_of_sums(*sums), nan_ok=True)
                found = ranks.precision_of_classes[name][c, w]
                ap = metrics.average_precision_of_sums(*sums)
                assert found == pytest.approx(ap, nan_ok=True)


def test_without_cells_nothing_is_defined() -> None:
    ranks = RankedCells(WEIGHTS).ranks
    assert np.isnan(ranks.auroc["all"]).all()
    assert np.isnan(ranks.precision_of_classes["unseen"]).all()
