"""A run that replaces another: the old one stays until the new one is whole, by hand."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from bsg_data.dataset.dataset import Dataset
from bsg_data.errors import BSGError, DatasetError
from bsg_data.seals import SEAL, read_seal, require_seal, write_seal
from bsg_models.errors import TrainingError
from bsg_models.runs import growth
from bsg_models.runs.checkpoint import read_header
from bsg_models.runs.growth import REPLACEMENT, growing_run
from bsg_models.runs.run_folder import (
    BEST,
    CONFIG,
    CURVE,
    FILES,
    LAST,
    LOG,
    MEMBERS,
    METRICS,
    refuse_run,
)
from bsg_models.runs.run_log import keep_log
from bsg_models.training import training
from bsg_models.training.learning_curve import EpochReport
from bsg_models.training.training import train_run
from bsg_models.zoo.config import RunConfig, find_config, override, validate_config

TINY = ("model.width=4", "model.depth=2", "training.epochs=4", "training.validate_every=2")


def network(*settings: str) -> RunConfig:
    tables = override(find_config("ceci-gcn").model_dump(mode="json"), [*TINY, *settings])
    return validate_config(tables, source="test")


def count() -> RunConfig:
    return find_config("train-mean")


def train(config: RunConfig, data: Path, run: Path, **how: bool) -> list[EpochReport]:
    return list(train_run(config, data, run, **how))


def stop(config: RunConfig, data: Path, run: Path, *, after: int, **how: bool) -> None:
    """Train, and stop after an epoch as Ctrl-C does."""
    steps = train_run(config, data, run, **how)
    for report in steps:
        if report.epoch == after:
            steps.close()  # type: ignore[attr-defined]


def read(folder: Path) -> dict[str, bytes]:
    """Return all files of a folder, the log aside, which tells the time."""
    files = (path for path in sorted(folder.rglob("*")) if path.is_file())
    aside = (LOG, SEAL, METRICS)
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in files
        if path.name not in aside
    }


@pytest.fixture
def run(dataset: Path, tmp_path: Path) -> Path:
    """A finished run of a model that counts, and a note that somebody keeps with it."""
    train(count(), dataset, tmp_path / "run")
    (tmp_path / "run" / "notes.txt").write_text("mine")
    return tmp_path / "run"


def test_a_forced_training_that_fails_leaves_the_old_run(
    run: Path, dataset: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = {path: path.read_bytes() for path in run.iterdir()}

    def fail(*_: object, **__: object) -> bool:
        assert growing_run(run).name == REPLACEMENT
        raise KeyboardInterrupt

    monkeypatch.setattr(training, "calibrate_if_wanted", fail)
    with pytest.raises(KeyboardInterrupt):
        train(find_config("gamma-poisson"), dataset, run, force=True)
    stop(network(), dataset, run, after=1, force=True)
    assert {path: path.read_bytes() for path in run.iterdir()} == before


def test_a_replacement_that_was_stopped_goes_on_and_ends_as_an_unbroken_run(
    run: Path, dataset: Path, tmp_path: Path
) -> None:
    before = read(run)
    stop(network(), dataset, run, after=3, force=True)
    kept = {name: data for name, data in read(run).items() if REPLACEMENT not in name}
    assert kept == before
    assert require_seal(run) is not None
    assert read_header(run / REPLACEMENT / LAST).epoch == 2
    with pytest.raises(TrainingError, match="holds a run already"):
        train(network(), dataset, run)
    with pytest.raises(TrainingError, match=r"bsg-replacement.*model\.dropout"):
        train(network("model.dropout=0.25"), dataset, run, resume=True)
    assert [report.epoch for report in train(network(), dataset, run, resume=True)] == [3, 4]
    train(network(), dataset, tmp_path / "unbroken")
    assert read(run) == {**read(tmp_path / "unbroken"), "notes.txt": b"mine"}
    assert require_seal(run) is not None


def test_resume_with_force_replaces_another_training_alone(run: Path, dataset: Path) -> None:
    """So a job that is restarted has one command line, wherever it was killed."""
    stop(network(), dataset, run, after=3, resume=True, force=True)
    assert growing_run(run) != run
    both = {"resume": True, "force": True}
    assert [report.epoch for report in train(network(), dataset, run, **both)] == [3, 4]
    assert train(network(), dataset, run, **both) == []
    with pytest.raises(TrainingError, match="was trained with another configuration"):
        train(count(), dataset, run, resume=True)
    train(count(), dataset, run, **both)
    assert sorted(read(run)) == sorted((BEST, CONFIG, "notes.txt"))


def test_a_network_does_not_go_on_in_the_run_of_a_model_that_counts(
    run: Path, dataset: Path
) -> None:
    before = read(run)
    with pytest.raises(TrainingError, match="was trained with another configuration"):
        train(network(), dataset, run, resume=True)
    assert read(run) == before


@pytest.mark.parametrize("call", ["stage_files", "remove_files", "_remove_replacement"])
def test_a_replacement_killed_as_it_takes_its_place_is_put_there_by_the_next_training(
    call: str, run: Path, dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    train(network(), dataset, tmp_path / "unbroken")
    real: Callable[..., object] = getattr(growth, call)

    def die(*args: object, **how: object) -> object:
        if (run / REPLACEMENT / SEAL).exists():  # the new run is whole
            raise KeyboardInterrupt
        return real(*args, **how)

    with monkeypatch.context() as broken:
        broken.setattr(growth, call, die)
        with pytest.raises(KeyboardInterrupt):
            train(network(), dataset, run, force=True)
    assert train(network(), dataset, run, resume=True) == []  # it was trained already
    assert read(run) == {**read(tmp_path / "unbroken"), "notes.txt": b"mine"}
    assert not (run / REPLACEMENT).exists()


def test_what_is_left_of_a_replacement_is_no_run(run: Path, dataset: Path) -> None:
    """A command was killed while it removed one that had been put in its place."""
    before = read(run)
    left = run / ".bsg-discarded"
    left.mkdir()
    for name in (f".{LOG}.partial", LAST):
        (left / name).write_bytes(b"half")
    assert growing_run(run) == run
    assert train(count(), dataset, run, resume=True) == []
    assert read(run) == before


@pytest.mark.parametrize("name", [*FILES, SEAL])
@pytest.mark.parametrize("force", [False, True])
def test_a_file_of_somebody_else_is_never_replaced(
    name: str, force: bool, dataset: Path, tmp_path: Path
) -> None:
    own = tmp_path / "own"
    own.mkdir()
    (own / name).write_text("mine")
    with pytest.raises(TrainingError, match=f"{name}: was not written by bsg-train"):
        train(count(), dataset, own, force=force, resume=not force)
    assert [path.read_text() for path in own.iterdir()] == ["mine"]


def test_a_log_is_there_before_any_other_file(dataset: Path, tmp_path: Path) -> None:
    """What was killed at its first file is a run of ours, and the next training replaces it."""
    run = tmp_path / "run"
    (run / CONFIG).mkdir(parents=True)  # so that the second file cannot be written
    with pytest.raises(DatasetError, match=CONFIG), keep_log(run, count(), Dataset.open(dataset)):
        pass
    (run / CONFIG).rmdir()
    assert [path.name for path in run.iterdir()] == [LOG]
    train(count(), dataset, run)
    assert (run / BEST).is_file()


def test_a_damaged_run_is_replaced_by_force(run: Path, dataset: Path) -> None:
    (run / BEST).write_bytes(b"damaged")
    with pytest.raises(BSGError, match=BEST):
        train(network(), dataset, run, resume=True)
    (run / CURVE).write_bytes(b"a figure of the old run")
    train(network(), dataset, run, force=True)
    assert read_header(run / BEST).config == network()
    assert not (run / CURVE).exists()


def test_members_of_an_old_ensemble_go_and_a_folder_of_somebody_else_stays(
    run: Path, dataset: Path
) -> None:
    member, other = run / MEMBERS / "train-mean", run / MEMBERS / "mine"
    train(count(), dataset, member)
    other.mkdir()
    (other / CONFIG).write_text("mine")
    train(network(), dataset, run, force=True)
    assert not member.exists()
    assert [path.read_text() for path in other.iterdir()] == ["mine"]


def test_a_replacement_that_is_a_link_or_holds_files_of_others_is_refused(
    run: Path, dataset: Path, tmp_path: Path
) -> None:
    (tmp_path / "elsewhere").mkdir()
    (run / REPLACEMENT).symlink_to(tmp_path / "elsewhere")
    with pytest.raises(DatasetError, match="is a link"):
        train(network(), dataset, run, force=True)
    (run / REPLACEMENT).unlink()
    (run / REPLACEMENT).mkdir()
    (run / REPLACEMENT / "photo.png").write_text("mine")
    before = read(run)
    with pytest.raises(DatasetError, match=r"photo\.png: was not written by bsg-train"):
        train(network(), dataset, run, force=True)
    assert read(run) == before


def test_a_replacement_that_has_saved_nothing_is_not_gone_on_with(run: Path, dataset: Path) -> None:
    """A command was killed before its first checkpoint: without --force the old run stays."""
    (run / REPLACEMENT).mkdir()
    (run / REPLACEMENT / LOG).write_bytes((run / LOG).read_bytes())
    before = {path.name: path.read_bytes() for path in run.iterdir() if path.is_file()}
    with pytest.raises(TrainingError, match="was trained with another configuration"):
        train(network(), dataset, run, resume=True)
    assert {path.name: path.read_bytes() for path in run.iterdir()} == before


def test_a_whole_replacement_that_was_changed_is_dropped_by_force(run: Path, dataset: Path) -> None:
    train(network(), dataset, run / REPLACEMENT)
    (run / REPLACEMENT / METRICS).write_text("changed")
    with pytest.raises(DatasetError, match=rf"{METRICS}: was changed"):
        train(network(), dataset, run, resume=True, force=True)
    train(count(), dataset, run, force=True)
    assert read_header(run / BEST).config == count()
    assert not (run / REPLACEMENT).exists()


@pytest.mark.parametrize("name", [REPLACEMENT, ".bsg-discarded"])
def test_a_file_where_a_replacement_goes_is_refused_before_anything_is_trained(
    name: str, run: Path, dataset: Path
) -> None:
    (run / name).write_text("mine")
    with pytest.raises(DatasetError, match=rf"{name}: was not written by bsg-train"):
        train(network(), dataset, run, force=True)
    assert (run / name).read_text() == "mine"


def test_a_folder_that_has_the_name_of_a_file_of_a_run_stays(run: Path, dataset: Path) -> None:
    (run / CURVE).mkdir()
    (run / CURVE / "mine.txt").write_text("mine")
    train(network(), dataset, run, force=True)
    assert (run / CURVE / "mine.txt").read_text() == "mine"
    assert not (run / REPLACEMENT).exists()


def ensemble(*settings: str) -> RunConfig:
    members = 'model.members=["train-mean", "ceci-gcn"]'
    tables = find_config("ensemble").model_dump(mode="json")
    return validate_config(override(tables, [members, *settings]), source="test")


@pytest.mark.parametrize("over", ["nothing", "a run"])
def test_files_of_somebody_else_where_a_member_goes_stay(
    over: str, dataset: Path, tmp_path: Path
) -> None:
    """They were removed, and replaced, when the member began and when the ensemble was whole."""
    run = tmp_path / "run"
    if over == "a run":
        train(count(), dataset, run)
    mine = run / MEMBERS / "train-mean"
    mine.mkdir(parents=True)
    for name in (CONFIG, CURVE):
        (mine / name).write_text("mine")
    with pytest.raises(TrainingError, match=r"train-mean/.*was not written by bsg-train"):
        train(ensemble(), dataset, run, force=True)
    assert [path.read_text() for path in sorted(mine.iterdir())] == ["mine", "mine"]


def test_members_that_are_no_folder_are_refused_before_anything_is_trained(
    run: Path, dataset: Path
) -> None:
    (run / MEMBERS).write_text("mine")
    with pytest.raises(TrainingError, match=f"{MEMBERS}: is a file"):
        train(ensemble(), dataset, run, force=True)
    assert not (run / REPLACEMENT).exists()


def test_an_ensemble_that_was_stopped_is_known_by_its_members(
    dataset: Path, tmp_path: Path
) -> None:
    run = tmp_path / "run"
    stop(ensemble(), dataset, run, after=10)
    before = read(run)
    assert f"{MEMBERS}/ceci-gcn/{LAST}" in before
    with pytest.raises(TrainingError, match=r"train-mean/.*\(seed: 0 → 5\)"):
        train(ensemble("seed=5"), dataset, run, resume=True)
    assert read(run) == before
    stop(ensemble("seed=5"), dataset, run, after=10, resume=True, force=True)
    assert read_header(run / REPLACEMENT / MEMBERS / "ceci-gcn" / LAST).config.seed == 5


@pytest.mark.parametrize("damage", ["changed", "gone"])
def test_resume_with_force_replaces_a_damaged_run(
    damage: str, dataset: Path, tmp_path: Path
) -> None:
    run = tmp_path / "run"
    train(network(), dataset, run)
    if damage == "changed":
        (run / METRICS).write_text("changed")
    else:
        (run / BEST).unlink()
        (run / SEAL).unlink()
    train(network(), dataset, run, resume=True, force=True)
    assert require_seal(run) is not None
    assert read_header(run / BEST).config == network()


def test_results_of_another_command_in_a_run_that_was_stopped_are_told(
    dataset: Path, tmp_path: Path
) -> None:
    run = tmp_path / "run"
    stop(network(), dataset, run, after=3)
    (run / "evaluation.json").write_text("{}")
    write_seal(run, ["evaluation.json"])
    with pytest.raises(DatasetError, match=r"holds other results \(evaluation\.json\)"):
        train(network(), dataset, run, resume=True)
    assert read_seal(run) == require_seal(run)


def test_no_other_results_go_into_a_run_that_was_stopped(dataset: Path, tmp_path: Path) -> None:
    run = tmp_path / "run"
    stop(network(), dataset, run, after=3)
    with pytest.raises(DatasetError, match="is a run of bsg-train"):
        refuse_run(run)
    refuse_run(tmp_path)
    refuse_run(tmp_path / "absent")


def test_a_finished_run_that_cannot_be_put_in_its_place_waits(
    run: Path, dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before, config = read(run), find_config("gamma-poisson")
    train(config, dataset, tmp_path / "unbroken")

    def fail(*_: object, **__: object) -> None:
        raise OSError("no space left")

    with monkeypatch.context() as broken:
        broken.setattr(growth, "link_or_copy", fail)
        with pytest.raises(TrainingError, match=r"no space left.*; the finished run is .*--resume"):
            train(config, dataset, run, force=True)
    kept = {name: data for name, data in read(run).items() if REPLACEMENT not in name}
    assert kept == before
    train(config, dataset, run, resume=True)
    assert read(run) == {**read(tmp_path / "unbroken"), "notes.txt": b"mine"}


def test_a_fit_by_counting_that_fails_at_its_end_leaves_nothing(
    run: Path, dataset: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It cannot go on: of a replacement that has a checkpoint and no seal nothing is of use."""
    before = read(run)

    def fail(*_: object) -> None:
        raise DatasetError("no space left")

    monkeypatch.setattr(growth, "seal_run", fail)
    with pytest.raises(DatasetError, match="no space left"):
        train(find_config("gamma-poisson"), dataset, run, force=True)
    assert read(run) == before


def test_files_that_a_killed_training_was_writing_go(run: Path, dataset: Path) -> None:
    before = read(run)
    (run / f".{LOG}.partial").write_bytes(b"half")
    (run / ".bsg-unfinished" / "new").mkdir(parents=True)  # killed while it put files in place
    train(count(), dataset, run, force=True)
    assert read(run) == before
    assert not (run / ".bsg-unfinished").exists()
