"""Every source file has a test file in the same place, or a line here that says where it is proved.

A file leaves the list when it gets a test file of its own; the list never grows without a reason.
"""

from __future__ import annotations

import re
from pathlib import PurePosixPath

import pytest
from conftest import REPOSITORY

PROVED_ELSEWHERE = {
    # source file: the test file, below tests/, that proves it
    "bsg_data/arrays.py": "test_architecture.py",
    "bsg_data/checks/census.py": "bsg_data/checks/test_dataset.py",
    "bsg_data/checks/edges.py": "bsg_data/checks/test_dataset.py",
    "bsg_data/checks/faults.py": "bsg_data/checks/test_dataset.py",
    "bsg_data/checks/files.py": "bsg_data/checks/test_dataset.py",
    "bsg_data/checks/objects.py": "bsg_data/checks/test_dataset.py",
    "bsg_data/checks/pairs.py": "bsg_data/checks/test_dataset.py",
    "bsg_data/checks/part.py": "bsg_data/checks/test_dataset.py",
    "bsg_data/checks/places.py": "bsg_data/checks/test_dataset.py",
    "bsg_data/checks/rooms.py": "bsg_data/checks/test_dataset.py",
    "bsg_data/checks/scenes.py": "bsg_data/checks/test_dataset.py",
    "bsg_data/checks/splits.py": "bsg_data/checks/test_dataset.py",
    "bsg_data/dataset/composition.py": "bsg_data/test_merge.py",
    "bsg_data/exports/catalogue.py": "bsg_data/exports/test_export.py",
    "bsg_data/dataset/growth.py": "bsg_data/test_build.py",
    "bsg_data/dataset/histograms.py": "bsg_data/dataset/test_categories.py",
    "bsg_data/dataset/manifest.py": "bsg_data/dataset/test_shards.py",
    "bsg_data/dataset/part.py": "bsg_data/dataset/test_dataset.py",
    "bsg_data/dataset/publication.py": "bsg_data/test_build.py",
    "bsg_data/dataset/schema.py": "bsg_data/dataset/test_shards.py",
    "bsg_data/errors.py": "bsg_data/test_build.py",
    "bsg_data/observation/explored_rooms.py": "bsg_data/observation/test_masks.py",
    "bsg_data/scene/mesh_coverage.py": "bsg_data/geometry/test_placement.py",
    "bsg_data/sources/assembly.py": "bsg_data/sources/test_hm3d.py",
    "bsg_data/sources/synthetic.py": "bsg_data/sources/test_catalogue.py",
    "bsg_models/belief/consistency.py": "bsg_models/belief/test_tables.py",
    "bsg_models/belief/header.py": "bsg_models/belief/test_document.py",
    "bsg_models/belief/table_rows.py": "bsg_models/belief/test_tables.py",
    "bsg_models/belief/nodes.py": "bsg_models/belief/test_network.py",
    "bsg_models/errors.py": "bsg_models/training/test_training.py",
    "bsg_models/evaluation/cell_metrics.py": "bsg_models/evaluation/test_measurement.py",
    "bsg_models/evaluation/class_errors.py": "bsg_models/evaluation/test_measurement.py",
    "bsg_models/evaluation/metric_kinds.py": "bsg_models/evaluation/test_catalogue.py",
    "bsg_models/evaluation/metric_rows.py": "bsg_models/evaluation/test_measurement.py",
    "bsg_models/evaluation/streams.py": "bsg_models/evaluation/test_measurement.py",
    "bsg_models/evaluation/truth.py": "bsg_models/evaluation/test_measurement.py",
    "bsg_models/robot/answers.py": "bsg_models/robot/test_seen_building.py",
    "bsg_models/runs/hub_files.py": "bsg_models/runs/test_hub.py",
    "bsg_models/runs/predictor.py": "bsg_models/belief/test_belief_graph.py",
    "bsg_models/runs/run_folder.py": "bsg_models/training/test_training.py",
    "bsg_models/search/catalogue.py": "bsg_models/search/test_planners.py",
    "bsg_models/search/exact_orders.py": "bsg_models/search/test_orders.py",
    "bsg_models/search/order_walks.py": "bsg_models/search/test_orders.py",
    "bsg_models/search/knowledge.py": "bsg_models/search/test_planners.py",
    "bsg_models/studies/comparison_table.py": "bsg_models/studies/test_comparison.py",
    "bsg_models/studies/measuring.py": "bsg_models/studies/test_comparison.py",
    "bsg_models/studies/search_cases.py": "bsg_models/studies/test_search_study.py",
    "bsg_models/studies/search_files.py": "bsg_models/studies/test_search_study.py",
    "bsg_models/training/epochs.py": "bsg_models/training/test_training.py",
    "bsg_models/training/learning_curve.py": "bsg_models/training/test_training.py",
    "bsg_models/training/optimiser.py": "bsg_models/training/test_training.py",
    "bsg_models/zoo/baselines.py": "bsg_models/zoo/test_models.py",
    "bsg_models/zoo/boosting.py": "bsg_models/zoo/test_counting_models.py",
    "bsg_models/zoo/calibration.py": "bsg_models/zoo/test_counting_models.py",
    "bsg_models/zoo/catalogue.py": "bsg_models/zoo/test_config.py",
    "bsg_models/zoo/conditional.py": "bsg_models/zoo/test_counting_models.py",
    "bsg_models/zoo/deepsets.py": "bsg_models/zoo/test_count_network.py",
    "bsg_models/zoo/ensemble.py": "bsg_models/zoo/test_counting_models.py",
    "bsg_models/zoo/gamma_poisson.py": "bsg_models/zoo/test_models.py",
    "bsg_models/zoo/gat.py": "bsg_models/zoo/test_count_network.py",
    "bsg_models/zoo/gcn.py": "bsg_models/zoo/test_models.py",
    "bsg_models/zoo/gin.py": "bsg_models/zoo/test_count_network.py",
    "bsg_models/zoo/message_passing.py": "bsg_models/zoo/test_count_network.py",
    "bsg_models/zoo/model.py": "bsg_models/zoo/test_models.py",
    "bsg_models/zoo/naive_bayes.py": "bsg_models/zoo/test_counting_models.py",
    "bsg_models/zoo/node_features.py": "bsg_models/zoo/test_count_network.py",
    "bsg_models/zoo/residual_gcn.py": "bsg_models/zoo/test_count_network.py",
    "bsg_models/zoo/room_sums.py": "bsg_models/zoo/test_models.py",
    "bsg_models/zoo/room_transformer.py": "bsg_models/zoo/test_count_network.py",
    "bsg_models/zoo/sage.py": "bsg_models/zoo/test_models.py",
    "bsg_models/zoo/settings.py": "bsg_models/zoo/test_config.py",
    "bsg_models/zoo/training_recipes.py": "bsg_models/zoo/test_count_network.py",
}
SOURCES = [
    path.relative_to(REPOSITORY).as_posix()
    for folder in ("bsg_data", "bsg_models", "cli")
    for path in sorted((REPOSITORY / folder).rglob("*.py"))
    if path.name != "__init__.py"
]


def own_test(source: str) -> str:
    path = PurePosixPath(source)
    return f"{path.parent}/test_{path.name}"


def test_every_source_file_has_a_test_file_or_is_listed() -> None:
    without = {s for s in SOURCES if not (REPOSITORY / "tests" / own_test(s)).is_file()}
    assert without - set(PROVED_ELSEWHERE) == set(), "write their test files"
    assert set(PROVED_ELSEWHERE) - without == set(), "take them off PROVED_ELSEWHERE"


NAMED = re.compile(r"\bbsg_(?:data|models|cli)(?:\.\w+)+")


def named_in(text: str) -> set[str]:
    """Return the source files whose dotted names a text holds: imports, and rows of registries."""
    names = (name.split(".") for name in NAMED.findall(text))
    files = {"/".join(parts[:end]) + ".py" for parts in names for end in (2, 3)}
    return files & set(SOURCES)


NEXT = {source: named_in((REPOSITORY / source).read_text("utf-8")) for source in SOURCES}


@pytest.mark.parametrize("source", sorted(PROVED_ELSEWHERE))
def test_the_test_that_is_named_reaches_the_source(source: str) -> None:
    """It imports the source, or what it imports does, at most two steps on."""
    test = REPOSITORY / "tests" / PROVED_ELSEWHERE[source]
    reached = named_in(test.read_text("utf-8"))
    for _ in range(2):
        reached |= {further for one in reached for further in NEXT[one]}
    assert source in reached
