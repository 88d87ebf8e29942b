"""Chromium without a window, for tests of pages; tests are skipped where it is not there."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
FLAGS = ["--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking"]


# The contrast of each text with what is behind it: in a picture, its halo and every room.
_CONTRASTS = """() => {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = 1;
  const brush = canvas.getContext("2d");
  const rgb = (colour) => {
    brush.clearRect(0, 0, 1, 1); brush.fillStyle = colour; brush.fillRect(0, 0, 1, 1);
    return [...brush.getImageData(0, 0, 1, 1).data];
  };
  const light = (colour) => rgb(colour).slice(0, 3).map((v) => v / 255)
    .map((v) => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4)
    .reduce((sum, v, k) => sum + v * [0.2126, 0.7152, 0.0722][k], 0);
  const ratio = (a, b) => {
    const [low, high] = [light(a), light(b)].sort((x, y) => x - y);
    return (high + 0.05) / (low + 0.05);
  };
  const ground = (one) => {
    const colour = getComputedStyle(one).backgroundColor;
    return rgb(colour)[3] === 255 || !one.parentElement ? colour : ground(one.parentElement);
  };
  const found = [];
  const walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  for (let text = walk.nextNode(); text; text = walk.nextNode()) {
    const one = text.parentElement, style = getComputedStyle(one);
    if (!text.data.trim() || !one.getClientRects().length) continue;
    const inPicture = one instanceof SVGElement;
    const behind = inPicture ? [style.stroke, ground(one)] : [ground(one)];
    const fore = inPicture ? style.fill : style.color;
    for (const back of behind)
      if (back !== "none") found.push([text.data.trim(), ratio(fore, back)]);
  }
  const name = document.querySelector(".name");
  for (const ground of document.querySelectorAll("polygon.ground"))
    found.push([`${name.textContent} over a room`,
      ratio(getComputedStyle(name).fill, getComputedStyle(ground).fill)]);
  return found;
}"""


@contextmanager
def start_browser() -> Iterator[Any]:
    """Start a browser that several pages are opened in."""
    playwright = pytest.importorskip("playwright.sync_api")
    if CHROMIUM is None:
        pytest.skip("no Chromium on this machine (Debian: apt-get install chromium)")
    with playwright.sync_playwright() as started:
        browser = started.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield browser
        browser.close()


@contextmanager
def open_page(browser: Any, path: Path, *, fragment: str = "", **options: Any) -> Iterator[Any]:
    """Open a file; at the end, fail if it had errors or showed a dialog.

    Args:
        browser: of `start_browser`.
        path: of the page.
        fragment: of the address, with its `#`.
        options: of the page, e.g. `color_scheme`.
    """
    faults: list[str] = []
    page = browser.new_page(**{"viewport": {"width": 1366, "height": 768}, **options})
    page.on("console", lambda said: faults.append(said.text) if said.type == "error" else None)
    page.on("pageerror", lambda error: faults.append(str(error)))
    page.on("dialog", lambda dialog: (faults.append(dialog.message), dialog.dismiss()))
    page.goto(f"file://{path}{fragment}")
    yield page
    assert faults == [], faults
    page.close()


def measure_contrasts(page: Any) -> list[tuple[str, float]]:
    """Return every text that is shown with its contrast, 1 to 21, as the WCAG defines it."""
    return [(text, ratio) for text, ratio in page.evaluate(_CONTRASTS)]
