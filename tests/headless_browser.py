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
