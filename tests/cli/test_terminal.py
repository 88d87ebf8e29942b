from __future__ import annotations

import io
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

import bsg_robot
from bsg_cli.terminal import Command, print_json, print_note, print_text, progress_bar
from bsg_data.errors import BSGError

SCRIPT = """
import os, time
from bsg_cli.terminal import worker_pool

if __name__ == "__main__":
    with worker_pool(2) as pool:
        print(*{pool.submit(os.getpid).result() for _ in range(20)}, flush=True)
        time.sleep(60)
"""


def is_running(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    stat = Path(f"/proc/{pid}/stat")  # where nobody reaps it, an ended process stays as a zombie
    return not (stat.is_file() and stat.read_text("utf-8").rpartition(")")[2].split()[0] == "Z")


def test_workers_end_with_a_parent_that_is_killed(tmp_path: Path) -> None:
    script = tmp_path / "parent.py"
    script.write_text(SCRIPT, "utf-8")
    parent = subprocess.Popen([sys.executable, str(script)], stdout=subprocess.PIPE, text=True)
    assert parent.stdout is not None
    workers = [int(pid) for pid in parent.stdout.readline().split()]
    assert workers
    assert all(map(is_running, workers))
    parent.send_signal(signal.SIGKILL)
    parent.wait()
    parent.stdout.close()
    for _ in range(200):
        if not any(map(is_running, workers)):
            break
        time.sleep(0.05)
    assert not any(map(is_running, workers))


def test_a_command_that_lacks_an_extra_names_it(monkeypatch: pytest.MonkeyPatch) -> None:
    def load(name: str) -> None:
        raise ModuleNotFoundError("No module named 'torch'", name="torch.nn")

    @click.command(cls=Command)
    def ask() -> None:
        bsg_robot.open_graph("home.json")

    monkeypatch.setattr("importlib.import_module", load)
    monkeypatch.delitem(vars(bsg_robot), "open_graph", raising=False)
    done = CliRunner().invoke(ask)
    assert done.exit_code == 1
    assert done.output == (
        "Error: torch is not installed; this needs it: "
        "pip install '.[train]' in your clone of the project (or name your wheel for the dot)\n"
    )


@pytest.mark.skipif(sys.version_info < (3, 11), reason="PYTHONSAFEPATH is of Python 3.11")
def test_workers_import_nothing_from_the_working_folder(tmp_path: Path) -> None:
    """`multiprocessing` starts them by `python -c`, for which Python looks there first."""
    (tmp_path / "downloaded").mkdir()
    for name in ("multiprocessing", "random", "bsg_data"):
        (tmp_path / "downloaded" / f"{name}.py").write_text("open('it ran', 'w')", "utf-8")
    script = tmp_path / "parent.py"
    script.write_text(SCRIPT.replace("time.sleep(60)", ""), "utf-8")
    ended = subprocess.run(
        [sys.executable, str(script)],
        cwd=tmp_path / "downloaded",
        env={key: value for key, value in os.environ.items() if key != "PYTHONSAFEPATH"},
        capture_output=True,
        text=True,
    )
    assert ended.returncode == 0, ended.stderr
    assert not (tmp_path / "downloaded" / "it ran").exists()


@pytest.mark.parametrize("columns", [None, 0])
def test_long_work_says_a_line_now_and_then_where_no_bar_fits(
    columns: int | None, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Off a terminal, and in one that does not say how wide it is."""
    if columns is not None:
        monkeypatch.setattr(os, "get_terminal_size", lambda _: os.terminal_size((columns, 0)))
        monkeypatch.setattr(sys.stderr, "fileno", lambda: 2)
    seconds = iter([0.0, 5.0, 31.0, 40.0, 61.5, 70.0])
    monkeypatch.setattr(time, "monotonic", lambda: next(seconds))
    with progress_bar("train", unit="epoch") as report:
        for epoch in (20, 46, 55, 70):
            report(epoch, 1160, f"val {epoch}")
        report(1160, 1160)
    monkeypatch.undo()
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.splitlines() == [
        "train: 46 of 1,160 epochs, val 46, about 18:34 left",
        "train: 70 of 1,160 epochs, val 70, about 20:31 left",
    ]


def test_a_terminal_gets_a_bar(monkeypatch: pytest.MonkeyPatch) -> None:
    screen = io.StringIO()
    monkeypatch.setattr(screen, "fileno", lambda: 2)
    monkeypatch.setattr(os, "get_terminal_size", lambda _: os.terminal_size((80, 24)))
    monkeypatch.setattr(sys, "stderr", screen)
    with progress_bar("train", unit="epoch") as report:
        report(1, 2, "val 3")
        time.sleep(0.15)  # a bar is not drawn more often
        report(2, 2, "val 2")
    assert "train" in screen.getvalue()
    assert "2/2" in screen.getvalue()
    assert "val 2" in screen.getvalue()


ENDED_BY = """
import os, signal, sys, click
from bsg_cli.terminal import Command

signal.signal(signal.SIGINT, signal.default_int_handler)

@click.command(cls=Command)
def main():
    try:
        os.kill(os.getpid(), signal.{signal})
        signal.pause()
    finally:
        print("put in order", flush=True)

main()
"""


@pytest.mark.parametrize(("name", "code"), [("SIGINT", 130), ("SIGTERM", 143)])
def test_a_command_that_is_asked_to_end_puts_in_order_first(name: str, code: int) -> None:
    script = ENDED_BY.format(signal=name)
    ended = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert (ended.returncode, ended.stdout) == (code, "put in order\n")
    assert "Traceback" not in ended.stderr


def test_ctrl_c_ends_the_imports_of_a_command_in_silence() -> None:
    script = (
        "import os, signal, sys\nsys.argv = ['bin/bsg-belief']\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "import bsg_cli\nos.kill(os.getpid(), signal.SIGINT)"
    )
    ended = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert (ended.returncode, ended.stderr) == (-signal.SIGINT, "")


def test_nothing_that_a_command_prints_is_obeyed_by_a_terminal() -> None:
    bad = "\x1b]0;evil\x07\x9b2J\N{RIGHT-TO-LEFT OVERRIDE}"

    @click.command(cls=Command)
    @click.argument("how")
    def command(how: str) -> None:
        if how == "error":
            raise BSGError(bad)
        if how == "usage":
            raise click.UsageError(bad)
        if how == "file":
            Path(f"/none/{bad}").read_text("utf-8")
        print_text(bad)

    for how in ("text", "error", "usage", "file"):
        output = CliRunner().invoke(command, [how]).output
        assert "evil" in output
        assert not {"\x1b", "\x07", "\x9b", "\N{RIGHT-TO-LEFT OVERRIDE}"} & set(output), how


def test_json_says_what_a_terminal_would_obey_as_escapes(
    capsys: pytest.CaptureFixture[str],
) -> None:
    name = "\x9b2J \u202elive \u2028 \x7f \U000e0001 é 🛏 \t\n"
    print_json({name: [name]})
    printed = capsys.readouterr().out
    assert not any(c in printed for c in "\x9b\u202e\u2028\x7f\U000e0001")
    assert "é 🛏" in printed
    assert json.loads(printed) == {name: [name]}


def test_a_note_is_one_line_whatever_a_stranger_wrote(capsys: pytest.CaptureFixture[str]) -> None:
    print_note("no room 'a\nError: all is well\r\n\u2028b'")
    assert len(capsys.readouterr().err.splitlines()) == 1
