"""Pages run nothing that a file brought: not by a name, and not if a name had become markup.

Names that are scripts, links and templates stand everywhere in the three pages, which are opened in
Chromium and clicked through. Then the same is written into the pages as markup, as if their
escaping had failed: the Content-Security-Policy of the page refuses it.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from headless_browser import start_browser
from replays import make_replay

from bsg_data.scene.class_space import ClassSpace
from bsg_models.belief.belief_graph import believe
from bsg_models.belief.count_distribution import poisson
from bsg_models.belief.expectation import Expectation
from bsg_models.belief.partial_graph import KnownRoom, PartialGraph, SeenObject
from bsg_models.rendering.explorer import ShownBelief, explorer_page
from bsg_models.rendering.pages import Table, write_report
from bsg_models.rendering.replay import replay_page

RUN = "top.ran=(window.ran=1)"  # what must never happen
PAYLOADS = (
    f"</script><script>{RUN}</script>",
    f"<!--<script>{RUN}</script>",
    f'"><img src=x onerror="{RUN}">',
    f"'><svg onload='{RUN}'>",
    f'" onmouseover="{RUN}" onfocus="{RUN}" onclick="{RUN}" autofocus x="',
    f"javascript:{RUN}",
    f'<a href="javascript:{RUN}">click</a>',
    f"</style><script>{RUN}</script><style>*{{background:url(https://example.invalid/x)}}",
    f"</title></textarea></svg><script>{RUN}</script>",
    f'<meta http-equiv="refresh" content="0;url=javascript:{RUN}">',
    '<base href="https://example.invalid/"><link rel=stylesheet href="https://example.invalid/x">',
    f"{{{{ self.__init__.__globals__ }}}}{{% set x = 1 %}}${{{RUN}}}`{RUN}`",
    f"\u2028{RUN}\u2029{RUN}//",
    f"\u202e{RUN}\u2066\ufeff\x00\x1b]0;x\x07",
    "__proto__",
    f"]]>{RUN}/*",
    f"';{RUN};//\\",
)
MARKUP = (
    f"<script>{RUN}</script>",
    f'<script src="data:text/javascript,{RUN}"></script>',
    f'<img src="x" onerror="{RUN}">',
    f'<iframe srcdoc="<script>{RUN}</script>"></iframe>',
    f'<iframe src="data:text/html,<script>{RUN}</script>"></iframe>',
    f'<object data="data:text/html,<script>{RUN}</script>"></object>',
    f'<a id="bait" href="javascript:{RUN}">bait</a>',
    '<form action="https://example.invalid/"><button id="bait">bait</button></form>',
    '<img src="https://example.invalid/picture.png">',
    '<style>body { background: url("https://example.invalid/x.png") }</style>',
    '<base href="https://example.invalid/"><img src="relative.png">',
)
CLICKS = "button, select, input, summary, polygon, g.room, circle, .legend span, h1, a"


def explorer(first: int) -> str:
    """Return an explorer in which every name is a payload, the first of which is given."""
    turn = count(first)

    def name() -> str:
        number = next(turn)
        return f"{PAYLOADS[number % len(PAYLOADS)]}{number - first}"

    space = ClassSpace.of(name(), tuple(name() for _ in range(8)))
    square = ((0.0, 0.0), (2.0, 0.0), (2.0, 2.0))
    rooms = (
        KnownRoom(name(), 0.5, True, name(), footprint=square, floor_index=0),
        KnownRoom(name(), 0.5, False, name()),
    )
    objects = tuple(SeenObject(name(), 1 + k % 2, name(), name(), k) for k in range(8))
    partial = PartialGraph(name(), space, 0.5, rooms, objects, ((1, 2),), source=name())
    inputs = partial.histograms().astype(float)
    believed = Expectation(inputs, poisson(np.full(inputs.shape, 0.7)))
    belief = believe(partial, believed, model=name())
    return explorer_page([ShownBelief(belief, np.ceil(belief.expected).astype(int))])


def replay(first: int) -> str:
    """Return a replay in which every name is a payload."""
    names = [PAYLOADS[(first + k) % len(PAYLOADS)] for k in range(8)]
    made = make_replay(name=names[0], artifact=names[1])
    walks = tuple(
        replace(walk, planner=names[2 + k], model=names[4 + k]) for k, walk in enumerate(made.walks)
    )
    told = replace(made, scene_id=names[6], walks=walks, chosen=names[7])
    return replay_page(replace(told, world=names[2]))


def report(first: int, folder: Path) -> str:
    """Return a report in which every name is a payload, with an explorer in its frame."""
    names = [PAYLOADS[(first + k) % len(PAYLOADS)] for k in range(8)]
    (folder / "figure.png").write_bytes(b"\x89PNG\r\n\x1a\n")
    write_report(
        folder / "made.html",
        title=names[0],
        facts=names[1:3],
        findings={names[3]: {names[4]: [names[5]]}},
        tables=[Table(names[7], names, [names], folded=True)],
        figures={names[1]: folder / "figure.png"},
        explorer=explorer(first),
    )
    return (folder / "made.html").read_text("utf-8")


def pages(first: int, folder: Path) -> dict[str, str]:
    """Return the three pages, by their names."""
    return {"explorer": explorer(first), "replay": replay(first), "report": report(first, folder)}


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with start_browser() as started:
        yield started


@contextmanager
def watch(browser: Any, path: Path) -> Iterator[tuple[Any, list[str], list[str]]]:
    """Open a page; give it, with what went wrong and what its policy refused, as they come."""
    faults: list[str] = []
    refused: list[str] = []
    page = browser.new_page(viewport={"width": 1366, "height": 768})
    page.set_default_timeout(2_000)

    def hear(said: Any) -> None:
        if said.type == "error":
            (refused if "Content Security Policy" in said.text else faults).append(said.text)

    def see(request: Any) -> None:
        inside = request.url.startswith(("file://", "data:", "about:srcdoc"))
        if not inside and request.failure != "csp":  # a name that nobody has fails otherwise
            faults.append(f"asked for {request.url}: {request.failure}")

    page.on("console", hear)
    page.on("requestfinished", see)
    page.on("requestfailed", see)
    page.on("pageerror", lambda error: faults.append(str(error)))
    page.on("dialog", lambda dialog: (faults.append(dialog.message), dialog.dismiss()))
    page.on("popup", lambda other: faults.append(f"opened {other.url}"))
    page.goto(f"file://{path}")
    yield page, faults, refused
    for frame in page.frames:
        if frame.evaluate("window.ran") is not None:
            faults.append(f"a script ran in {frame.url}")
    if not page.url.startswith(f"file://{path}"):
        faults.append(f"the page became {page.url}")
    page.close()


def click_through(page: Any) -> int:
    """Send every event that a visitor makes to everything that can take one; return how many."""
    return sum(
        int(
            frame.evaluate(
                """(wanted) => {
  const all = () => [...document.querySelectorAll(wanted)];
  let sent = 0;
  for (let k = 0; k < Math.min(all().length, 120); k++) {
    const one = all()[k];
    for (const kind of ["mouseover", "mouseenter", "focus", "mousedown", "click", "keydown"])
      { one.dispatchEvent(new MouseEvent(kind, { bubbles: true })); sent++; }
    if (one.tagName === "SELECT")
      for (const option of [...one.options]) {
        one.value = option.value;
        one.dispatchEvent(new Event("change", { bubbles: true }));
        sent++;
      }
  }
  return sent;
}""",
                CLICKS,
            )
        )
        for frame in page.frames
    )


@pytest.mark.heavy
def test_a_hostile_name_runs_nothing(browser: Any, tmp_path: Path, full: bool) -> None:
    turns = range(len(PAYLOADS)) if full else range(1)
    misses: dict[str, list[str]] = {"explorer": [], "replay": [], "report": []}
    for first in turns:
        for kind, text in pages(first, tmp_path).items():
            (tmp_path / "page.html").write_text(text, "utf-8")
            with watch(browser, tmp_path / "page.html") as (page, faults, refused):
                assert click_through(page) > 20, kind
                assert page.locator("iframe").count() == (kind == "report")
                page.keyboard.press("End")
            misses[kind] += [f"turn {first}: {what}" for what in (*faults, *refused)]
    assert not any(misses.values()), misses


@pytest.mark.heavy
@pytest.mark.parametrize("kind", ["explorer", "replay", "report"])
def test_the_policy_refuses_what_no_page_escaped(browser: Any, tmp_path: Path, kind: str) -> None:
    head, body, rest = pages(0, tmp_path)[kind].partition("<body>\n")
    (tmp_path / "page.html").write_text(head + body + "".join(MARKUP) + rest, "utf-8")
    with watch(browser, tmp_path / "page.html") as (page, faults, refused):
        for bait in page.locator("#bait").all():
            bait.evaluate("one => one.click()")
        page.wait_for_timeout(100)
    assert [fault for fault in faults if "ran in" in fault or "asked for" in fault] == []
    assert len(refused) > 5
