from __future__ import annotations

import click
import pytest
from click.testing import CliRunner

from bsg_cli.options import Fraction, split_names, workers_option


def test_a_list_has_each_name_once() -> None:
    assert split_names("star, tree,,star", option="--worlds") == ("star", "tree")
    assert split_names(None, option="--worlds") is None
    with pytest.raises(click.UsageError, match="--worlds names nothing"):
        split_names(" ,", option="--worlds")


@pytest.mark.parametrize(("text", "code"), [("0", 0), ("1", 0), ("nan", 2), ("1.01", 2), ("-1", 2)])
def test_a_fraction_is_a_number_from_0_to_1(text: str, code: int) -> None:
    command = click.command()(
        click.option("--fraction", type=Fraction(0, 1))(lambda fraction: None)
    )
    assert CliRunner().invoke(command, ["--fraction", text]).exit_code == code


def test_no_machine_is_asked_for_processes_without_end() -> None:
    command = click.command()(workers_option(lambda workers: click.echo(workers.processes)))
    assert CliRunner().invoke(command, ["--workers", "3"]).output == "3\n"
    for number in ("0", "1025", "9" * 30):
        assert CliRunner().invoke(command, ["--workers", number]).exit_code == 2
