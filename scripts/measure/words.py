"""Measure the words of the documentation: pages, words, and the longest sentence.

Generated parts, code, tables and headings are not prose and are not counted.

Example:
    python scripts/measure/words.py
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parent.parent.parent
BLOCKS = (
    r"\A---\n.*?\n---\n",  # front matter
    r"<!-- generated:.*?<!-- end -->",
    r"```.*?```",
    r"<!--.*?-->",
)
LINES = (
    r"<[^>\n]+>",
    r"^\s*\|.*$",  # rows of tables
    r"^#.*$",
    r"!\[[^\]]*\]\([^)]*\)",
)
LINK = re.compile(r"\[([^\]]*)\]\([^)]*\)")
CODE = re.compile(r"`[^`]*`")
LIST_ENTRY = re.compile(r"^\s*(?:[-*]|\d+\.|>|!!!.*|\?\?\?.*)\s+", re.MULTILINE)
END_OF_SENTENCE = re.compile(r"(?<=[.!?])[*_)\"”]*\s+(?=[\W_]*[A-ZÀ-Ý0-9])")


def find_pages(repository: Path = REPOSITORY) -> list[Path]:
    """Return every page of prose: what the site shows."""
    folders = ("docs", "mappings", "weights")
    below = (path for folder in folders for path in (repository / folder).rglob("*.md"))
    return sorted([*repository.glob("*.md"), *below])


def read_prose(text: str) -> str:
    r"""Return the prose of a page; a piece of code counts as one word.

    >>> read_prose("# Title\n\nSee `a b` [here](x.md).\n\n| a | b |\n")
    'See Code here.'
    >>> read_prose("| `<a` |\n\nFirst.\n\n`b>` is next.")
    'First.\n\nCode is next.'
    """
    for pattern in BLOCKS:
        text = re.sub(pattern, "\n", text, flags=re.DOTALL)
    text = CODE.sub("Code", text)  # before tags: code may hold a bracket
    for pattern in LINES:
        text = re.sub(pattern, "\n", text, flags=re.MULTILINE)
    return LINK.sub(r"\1", text).strip()


def split_sentences(prose: str) -> Iterator[str]:
    r"""Yield the sentences of prose; a paragraph and an entry of a list end one.

    >>> list(split_sentences("One is here. Two\nis there.\n\n- three\n- four"))
    ['One is here.', 'Two is there.', 'three', 'four']
    """
    for block in re.split(r"\n\s*\n|\n(?=\s*(?:[-*]|\d+\.)\s)", prose):
        text = " ".join(LIST_ENTRY.sub("", block).split())
        yield from (sentence for sentence in END_OF_SENTENCE.split(text) if sentence)


def find_longest(prose: str) -> str:
    """Return the sentence with the most words; empty without any."""
    return max(split_sentences(prose), key=count_words, default="")


def count_words(prose: str) -> int:
    """Return the number of words."""
    return len(prose.split())


def main() -> int:
    """Print a row a page, then the sum."""
    total, longest = 0, ""
    for path in (pages := find_pages()):
        prose = read_prose(path.read_text("utf-8"))
        found = find_longest(prose)
        longest = max(longest, found, key=count_words)
        total += count_words(prose)
        name = path.relative_to(REPOSITORY).as_posix()
        print(f"{count_words(prose):6,} {count_words(found):4} {name}")
    print(
        f"{total:,} words on {len(pages)} pages; the longest sentence has {count_words(longest)}:"
    )
    print(longest)
    return 0


if __name__ == "__main__":
    sys.exit(main())
