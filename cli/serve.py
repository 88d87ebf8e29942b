"""`bsg-serve`: answer questions about robots' maps, for agents (MCP) and over HTTP."""

from __future__ import annotations

import errno
import re
import socket

import click
from click.core import ParameterSource

import bsg_models
from bsg_cli.options import model_option
from bsg_cli.terminal import Command, importing_nothing_from_here, print_note
from bsg_data.errors import BSGError, ask_to_install
from bsg_data.words.shown import SHOWN

_NAME = re.compile(r"(?:\[[0-9a-fA-F:.]+\]|[A-Za-z0-9._-]+)")
_PORT = re.compile(r":[0-9]+$")
_EVERYWHERE = ("0.0.0.0", "::")  # noqa: S104 -- addresses that are no names


@click.command("bsg-serve", cls=Command)
@model_option("The model that answers: a shipped one, or a trained run.  [default: universal]")
@click.option("--stdio", is_flag=True, help="Speak MCP on stdin and stdout; an agent starts this.")
@click.option("--host", default="127.0.0.1", show_default=True, help="Address to listen on.")
@click.option(
    "--port",
    type=click.IntRange(0, 65535),
    default=8000,
    show_default=True,
    help="Port to listen on; 0 for any that is free.",
)
@click.option(
    "--allow-host",
    "names",
    multiple=True,
    metavar="NAME",
    help="A name or address by which others reach this machine: by --host, or through a proxy. "
    "Repeat it for several.",
)
def main(model: str | None, stdio: bool, host: str, port: int, names: tuple[str, ...]) -> None:
    """Answer questions about robots' maps, for agents (MCP) and over HTTP.

    A question brings its map, and nothing is stored. MCP is at /mcp, the description of HTTP at
    /openapi.json. Only this machine is listened to, unless --host says otherwise; there are no
    passwords. docs/robot-software.md shows how to ask. It runs until Ctrl-C or SIGTERM.

    \b
    Example:
      bsg-serve
      bsg-serve --stdio
      bsg-serve --host 0.0.0.0 --allow-host robot.local
    """
    try:
        from bsg_robot.service.http import listen
        from bsg_robot.service.tools import speak
    except ModuleNotFoundError as error:
        if str(error.name).startswith("bsg_"):
            raise
        raise ModuleNotFoundError(
            f"bsg-serve needs {error.name}: {ask_to_install('serve')}", name=error.name
        ) from error
    from bsg_models.runs.found_model import TERMS

    if not host.strip():
        raise click.UsageError("--host: expected an address to listen on, found none")
    asked = click.get_current_context().get_parameter_source
    for name in ("host", "port", "names"):
        if stdio and asked(name) is not ParameterSource.DEFAULT:
            option = "allow-host" if name == "names" else name
            raise click.UsageError(f"--stdio does not use --{option}; leave one of them out")
    names = tuple(map(_read_host, names))
    if model is None:
        model = bsg_models.DEFAULT_MODEL
        print_note(TERMS)
    bsg_models.Predictor(model)  # or no such model, before anything is answered
    with importing_nothing_from_here():
        if stdio:
            speak(model, print_note)
            return
        with _open_door(host, port) as door:
            shown = f"[{host}]" if ":" in host else host
            print_note(f"listening on http://{shown}:{door.getsockname()[1]}; Ctrl-C ends it")
            if host in _EVERYWHERE and not names:
                print_note("others are refused until --allow-host says how they call this machine")
            own = () if host in _EVERYWHERE else (shown,)
            listen(model, door, hosts=(*own, *names))


def _open_door(host: str, port: int) -> socket.socket:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    try:
        door = socket.create_server((host, port), family=family, backlog=2048)
    except OSError as error:
        if error.errno == errno.EADDRINUSE:
            fault = (
                f"port {port} of {host} is taken; take another --port, or 0 for any that is free"
            )
        else:
            fault = f"--host {host}: this machine has no such address ({error.strerror})"
        raise BSGError(fault, code="address") from error
    # An answer goes out at once; asyncio says so only for sockets that it opens itself.
    door.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return door


def _read_host(host: str) -> str:
    """Return a name of `--allow-host`, without its port."""
    name = _PORT.sub("", host)
    if not _NAME.fullmatch(name):
        raise click.UsageError(
            f"--allow-host {host[:SHOWN]}: expected a name or an address, as in robot.local, "
            "192.0.2.7 or [2001:db8::1], without http:// and without *"
        )
    return name.lower()
