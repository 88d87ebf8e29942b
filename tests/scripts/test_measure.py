"""Every script that makes a page of results, on a tiny leaderboard."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from conftest import REPOSITORY, annotation_text, load_script, write_scene

from bsg_data.build import build_dataset
from bsg_data.dataset.dataset import Dataset
from bsg_data.errors import DatasetError
from bsg_data.recipes import MaskRecipe
from bsg_data.sources.hm3d import HM3DFolder

PAGES = (
    "leaderboard",
    "masks",
    "fixtures",
    "ablation",
    pytest.param("search", marks=pytest.mark.heavy),
)
FEW = {
    "masks": ["--draws=1", "--resamples=5", "--orders=1", "--models", "gamma-poisson@rooms"],
    "fixtures": ["--draws=2", "--resamples=5", "--models", "mixture@uniform"],
    "search": ["--draws=1", "--episodes=4", "--worlds", "star:1-10", "--models", "mixture@uniform"],
    "ablation": ["--draws=1", "--resamples=5", "--base=mixture@rooms"],
}


@pytest.mark.parametrize("name", PAGES)
def test_a_script_writes_its_page(board: Path, tmp_path: Path, name: str) -> None:
    page = tmp_path / f"{name}.md"
    argv = [f"--leaderboard={board}", f"--out={page}", *FEW.get(name, [])]
    assert load_script(f"measure/{name}").main(argv) == 0
    text = page.read_text("utf-8")
    assert text.startswith("# ")
    assert f"python scripts/measure/{name}.py --leaderboard=board --out={name}.md" in text
    assert "12 buildings, class space hm3d45-v2" in text
    assert str(tmp_path.parent) not in text
    assert "nan" not in text
    tables = re.findall(r"(?:^\|.*\n)+", text, re.MULTILINE)
    assert tables
    for table in tables:
        assert len({line.count("|") for line in table.splitlines()}) == 1


def test_rooms_that_were_not_entered_are_measured_alone(board: Path, tmp_path: Path) -> None:
    """There, and only there, a model that gives every room the same answer has an AUROC of 0.5."""
    page = tmp_path / "page.md"
    load_script("measure/leaderboard").main([f"--leaderboard={board}", f"--out={page}"])
    uniform, rooms, alone = page.read_text("utf-8").split("\n## ")[1:4]
    assert uniform.startswith("Masks: uniform\n\n|")
    assert rooms.startswith("Masks: rooms\n\nAll rooms count here.")
    assert alone.startswith("Rooms not entered, masks: rooms\n")
    (row,) = re.findall(r"^\| `gamma-poisson` \| ([\d.]+) ", alone, re.MULTILINE)
    assert row == "0.5000"
    (row,) = re.findall(r"^\| `gamma-poisson` .*$", rooms, re.MULTILINE)
    assert float(row.split("|")[5].split()[0]) > 0.6


def test_rooms_without_area_or_label_are_no_result(board: Path, tmp_path: Path) -> None:
    script = load_script("measure/room_size")
    with pytest.raises(DatasetError, match="no unvisited room has a known floor area"):
        script.main([f"--leaderboard={board}", f"--out={tmp_path / 'page.md'}", "--draws=1"])


def test_one_source_is_tested_on_another(board: Path, tmp_path: Path) -> None:
    """The other one is of HM3D, too, so that all buildings are of its part."""
    for k in range(6):
        rooms = {0: ["sofa", "tv", "lamp"], 1: ["bed", "lamp"] * (k + 3)}
        write_scene(tmp_path / "raw", f"{900 + k:05d}-zyxwvutsr{k:02d}", annotation_text(rooms))
    build_dataset(HM3DFolder(tmp_path / "raw"), tmp_path / "other")
    page = tmp_path / "transfer.md"
    load_script("measure/transfer").main(
        [
            f"--hm3d={board.parent / 'dataset'}",
            f"--behavior={tmp_path / 'other'}",
            f"--runs={tmp_path / 'runs'}",
            f"--out={page}",
            *("--model=gamma-poisson", "--folds=3", "--draws=1", "--resamples=5"),
        ]
    )
    text = page.read_text("utf-8")
    assert "| trained on | HM3D (18) |" in text
    for name in ("HM3D", "BEHAVIOR", "HM3D and BEHAVIOR"):
        assert re.search(rf"^\| {name} \| -?\d", text, re.MULTILINE)


def test_a_variant_is_compared_with_its_base(board: Path, tmp_path: Path) -> None:
    """A fixed zero where both are the same model, and the others by name."""
    page = tmp_path / "ablation.md"
    options = ["--draws=1", "--resamples=5", "--base=mixture@rooms"]
    script = load_script("measure/ablation")
    script.main([f"--leaderboard={board}", f"--out={page}", *options])
    rows = re.findall(r"^\| `(.+?)`", page.read_text("utf-8"), re.MULTILINE)
    assert rows == ["mixture@rooms", "gamma-poisson@rooms"]


RESULTS = REPOSITORY / "docs" / "results"
MEASURED = sorted(path for path in RESULTS.glob("*.md") if path.name != "README.md")


def test_a_page_of_results_says_how_it_was_made() -> None:
    """A section at its end, with the command, the date and the versions; the index has its row."""
    index = (RESULTS / "README.md").read_text("utf-8")
    assert re.findall(r"^\| \[\w+\]\(([^)]+)\)", index, re.MULTILINE)
    for path in MEASURED:
        _, *sections = path.read_text("utf-8").split("\n## ")
        assert sections[-1].startswith("How it was made\n\n```"), path.name
        assert re.search(r"^- Date: \d{4}-\d\d-\d\d$", sections[-1], re.MULTILINE), path.name
        assert f"]({path.name})" in index, path.name


def test_told_shares_are_beside_true_ones(dataset: Path, tmp_path: Path) -> None:
    """One half is told under `uniform`; rooms that were entered hide nothing under `rooms`."""
    page = tmp_path / "told.md"
    argv = [f"--data={dataset}", f"--out={page}", "--draws=20"]
    assert load_script("measure/told_shares").main(argv) == 0
    text = page.read_text("utf-8")
    rows = re.findall(
        r"^\| `(\w+)` \| ([\d.]+) \| (.+), (.+) \| (.+), (.+) \|$", text, re.MULTILINE
    )
    shares = {(name, fraction): list(map(float, cells)) for name, fraction, *cells in rows}
    assert len(shares) == 25
    assert shares["uniform", "0.5"][0] == 50
    assert shares["rooms", "0.5"][2:] == [0, 0]
    assert all(abs(told - true) < 10 for told, true, *_ in shares.values())
    assert "python scripts/measure/told_shares.py --data=dataset" in text


def test_a_part_is_shown_or_hidden_with_its_thing(tmp_path: Path) -> None:
    """Of curtain and bed one is hidden, and of rod and wall: half of the curtains gone show it."""
    write_scene(tmp_path / "raw", "00900-zyxwvutsr00", annotation_text({0: CURTAINS}))
    build_dataset(HM3DFolder(tmp_path / "raw"), tmp_path / "dataset")
    data, script = Dataset.open(tmp_path / "dataset"), load_script("measure/told_shares")
    found, shown = script.count_parts(data, MaskRecipe(), 400)
    assert found == pytest.approx(200, abs=40)
    assert shown == pytest.approx(found / 2, abs=35)
    again, together = script.count_parts(data, MaskRecipe(parts=True), 400)
    assert (again, together) == (found, 0)


CURTAINS = ["curtain", "bed", "curtain rod", "wall"]


def test_ways_to_tell_the_hidden_share_are_compared(
    dataset: Path, run: Path, tmp_path: Path
) -> None:
    page = tmp_path / "hidden_share.md"
    script = load_script("measure/hidden_share")
    argv = [f"--data={dataset}", f"--out={page}", "--models", str(run), "--draws=3"]
    assert script.main(argv) == 0
    text = page.read_text("utf-8")
    assert "`gamma-poisson`: −log P(hidden counts) is " in text
    assert "The model was calibrated on the val buildings" in text
    rows = dict(re.findall(r"^\| ([^|]+?) \| ([\d.]+) \|", text, re.MULTILINE))
    assert list(rows) == list(script.WAYS)
    assert float(rows[script.TRUE]) == 0
    assert float(rows["no estimate, integrated over"]) > 0
    assert "nan" not in text
    assert str(tmp_path.parent) not in text


def test_a_look_errs_as_much_as_it_says() -> None:
    script, rng = load_script("measure/hidden_share"), np.random.default_rng(0)
    looks = [script.look(rng, 0.6, 5.4) for _ in range(2000)]
    assert np.mean([one.mean for one in looks]) == pytest.approx(0.6, abs=0.02)
    assert np.std([one.mean for one in looks]) == pytest.approx((0.24 / 6.4) ** 0.5, abs=0.02)
