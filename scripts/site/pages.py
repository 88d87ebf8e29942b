"""Pages of the site that do not lie in `docs`: a hook of mkdocs, which `mkdocs.yml` names.

Some pages of the site are elsewhere in the repository, as README.md and the class maps. They get a
place on the site here, and links are rewritten so that the same file reads well in both places.
The Python reference is a page a room, made of the public names of the packages.
"""

from __future__ import annotations

import ast
import posixpath
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.nav import Navigation
from mkdocs.structure.pages import Page

REPOSITORY = Path(__file__).resolve().parents[2]
ELSEWHERE = {  # path in the repository → place on the site
    "README.md": "index.md",
    "CHANGELOG.md": "changelog.md",
    "CONTRIBUTING.md": "contributing.md",
    "SECURITY.md": "security.md",
    "LICENSE": "LICENSE.txt",
    "NOTICE": "NOTICE.txt",
    "mappings/README.md": "class-maps.md",
    "mappings/hm3d45-v1.md": "class-maps/hm3d45-v1.md",
    "mappings/hm3d-wide-v1.md": "class-maps/hm3d-wide-v1.md",
    "bsg_robot/tables/README.md": "robot-tables.md",
    **{
        f"weights/{path.name}": f"model-cards/{path.name}"
        for path in sorted((REPOSITORY / "weights").glob("*.md"))
    },
}
SOURCES = {
    ".csv": "text",
    ".py": "python",
    ".toml": "toml",
    ".xml": "xml",
}  # shown as code, by its language
PACKAGES = ("bsg_data", "bsg_models", "bsg_robot")
_IN_ORDER: list[Page] = []
SHIM = "assets/iframe-worker.js"
_SHIM = "https://unpkg.com/iframe-worker/shim"
_LINK = re.compile(r"(?<=\]\()(?!\w+:|#)(?P<path>[^)#\s]+)(?=[)#])")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages that lie elsewhere, and those of the Python reference."""
    for source, place in ELSEWHERE.items():
        text = (REPOSITORY / source).read_text("utf-8")
        files.append(File.generated(config, place, content=text))
    for place, text in (*reference_pages(), *source_pages()):
        files.append(File.generated(config, place, content=text))
    return files


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Put the pages of the Python reference into the navigation."""
    entries = [place for place, _ in reference_pages()]
    for section in config.nav or []:
        for pages in section.values():
            for entry in pages if isinstance(pages, list) else ():
                if isinstance(entry, dict) and "api/" in entry.values():
                    entry["Python API"] = entries
    return config


def on_page_markdown(markdown: str, page: Page, **_: Any) -> str:
    """Rewrite links between files of the repository to links between pages of the site."""
    return rewrite_links(markdown, page.file.src_uri)


def on_nav(nav: Navigation, **_: Any) -> None:
    """Remember the pages in the order of the navigation, for `llms.txt`."""
    _IN_ORDER[:] = [page for page in nav.pages if not page.file.src_uri.startswith("api/")]


def on_post_build(config: MkDocsConfig) -> None:
    """Write all prose into one file, `llms.txt`, for those who ask a language model."""
    texts = [f"<!-- {page.file.src_uri} -->\n\n{page.file.content_string}" for page in _IN_ORDER]
    Path(config.site_dir, "llms.txt").write_text("\n\n".join(texts), "utf-8")


def on_post_page(output: str, page: Page, **_: Any) -> str:
    """Load the script that the search needs on a disk from the site; the theme names a server."""
    return output.replace(_SHIM, posixpath.relpath(SHIM, posixpath.dirname(page.url) or "."))


def on_post_template(output: str, template_name: str, **_: Any) -> str:
    """Do the same on pages that are not made of Markdown, as that of a missing page."""
    return output.replace(_SHIM, f"/{SHIM}")


def rewrite_links(markdown: str, place: str) -> str:
    """Return a page with links to where the files of the repository are on the site.

    >>> rewrite_links("[maps](mappings/README.md#rules)", "index.md")
    '[maps](class-maps.md#rules)'
    >>> rewrite_links("[robots](../docs/robot.md)", "class-maps.md")
    '[robots](robot.md)'
    """
    sources = {there: source for source, there in ELSEWHERE.items()}
    source = sources.get(place, f"docs/{place}")

    def rewrite(link: re.Match[str]) -> str:
        target = posixpath.normpath(posixpath.join(posixpath.dirname(source), link["path"]))
        return posixpath.relpath(_find_place(target), posixpath.dirname(place) or ".")

    return _LINK.sub(rewrite, markdown)


def _find_place(path: str) -> str:
    """Return where a file of the repository is on the site."""
    if path in ELSEWHERE:
        return ELSEWHERE[path]
    if Path(path).suffix in SOURCES and (REPOSITORY / path).is_file():
        return f"source/{path}.md"
    return path.removeprefix("docs/")  # whatever is not there mkdocs complains of


def source_pages() -> Iterator[tuple[str, str]]:
    """Yield place and text of every file of code or data that a page links to, and of its page."""
    linked = set()
    texts = [*(REPOSITORY / "docs").rglob("*.md"), *(REPOSITORY / path for path in ELSEWHERE)]
    for page in texts:
        for link in _LINK.finditer(page.read_text("utf-8")):
            target = (page.parent / link["path"]).resolve()
            if target.suffix in SOURCES and target.is_file():
                linked.add(target)
    for path in sorted(linked):
        name = path.relative_to(REPOSITORY).as_posix()
        fence = "``````"
        language, text = SOURCES[path.suffix], path.read_text("utf-8").rstrip()
        link = f"[Download this file]({path.name})"
        yield f"source/{name}.md", f"# {name}\n\n{link}\n\n{fence}{language}\n{text}\n{fence}\n"
        yield f"source/{name}", path.read_text("utf-8")


def reference_pages() -> Iterator[tuple[str, str]]:
    """Yield place and text of the pages of the Python reference: an index, and one a room."""
    rooms = public_names()
    yield "api/README.md", _write_index(rooms)
    for room, names in rooms.items():
        parts = [f"# {room}", _describe(room), *(f"::: {name}" for name in names)]
        yield f"api/{room}.md", "\n\n".join(parts) + "\n"


def public_names() -> dict[str, list[str]]:
    """Return the public names of the packages, whole, by the room that they are in.

    What lies in a file beside the rooms is listed under its package.
    """
    rooms: dict[str, list[str]] = {}
    for package in PACKAGES:
        stubs = sorted((REPOSITORY / package).glob("*.pyi"))  # the root's, and `extend`
        for node in (node for path in stubs for node in ast.parse(path.read_text("utf-8")).body):
            if isinstance(node, ast.ImportFrom) and node.module != "testing":
                is_room = "." in str(node.module)
                room = f"{package}.{str(node.module).split('.')[0]}" if is_room else package
                names = [f"{package}.{node.module}.{alias.name}" for alias in node.names]
                rooms.setdefault(room, []).extend(names)
        if (REPOSITORY / package / "testing.py").exists():
            rooms[f"{package}.testing"] = [f"{package}.testing"]
    return {room: sorted(rooms[room], key=_last) for room in sorted(rooms)}


def _last(name: str) -> str:
    return name.rpartition(".")[2].casefold()


def _describe(room: str) -> str:
    """Return what the docstring of a room says."""
    folder = REPOSITORY.joinpath(*room.split("."))
    path = folder / "__init__.py" if folder.is_dir() else folder.with_suffix(".py")
    return ast.get_docstring(ast.parse(path.read_text("utf-8"))) or ""


def _write_index(rooms: dict[str, list[str]]) -> str:
    """Return the first page of the Python reference: every name with a link."""
    lines = [
        "# Python API",
        "",
        "Import every name from its package: `from bsg_data import Dataset`, ",
    ]
    lines += ["`from bsg_robot import open_graph`. Each is loaded when it is first used.", ""]
    for room, names in rooms.items():
        lines += [f"## [{room}]({room}.md)", "", _describe(room).partition("\n\n")[0], ""]
        lines += [" · ".join(f"[`{name.rpartition('.')[2]}`][{name}]" for name in names), ""]
    return "\n".join(lines)
