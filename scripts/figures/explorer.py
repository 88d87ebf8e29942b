"""Take the picture of the explorer that the docs show; needs Chromium.

python scripts/figures/explorer.py --out docs/figures/explorer.png
"""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path

import click
from playwright.sync_api import sync_playwright

from bsg_models import DEFAULT_MODEL, View, open_graph, write_explorer

HOME = Path(__file__).resolve().parents[2] / "docs" / "home.json"


@click.command(help=__doc__, context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--out", type=click.Path(path_type=Path), required=True, help="The picture, a PNG.")
def main(out: Path) -> None:
    """Open the beliefs about docs/home.json and take the picture."""
    browser = shutil.which("chromium") or shutil.which("chromium-browser")
    if browser is None:
        raise click.ClickException("no Chromium on the path; on Debian: apt install chromium")
    belief = open_graph(HOME, model=DEFAULT_MODEL).belief()
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        page = Path(folder, "home.html")
        write_explorer([View(belief)], page)
        chromium = playwright.chromium.launch(executable_path=browser, args=["--no-sandbox"])
        window = chromium.new_page(viewport={"width": 1200, "height": 700})
        window.goto(page.as_uri())
        window.screenshot(path=out)
        chromium.close()


if __name__ == "__main__":
    main()
