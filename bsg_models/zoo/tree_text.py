"""Check the text of boosted trees before LightGBM reads it.

LightGBM's C++ reader trusts the text: a child that is its own parent hangs it, and a number that is
too large writes outside its memory. So this module reads the text first, checks it, and writes a
new text for LightGBM. Every child must come after its parent, every feature and leaf must exist,
and every value must be finite.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator, Mapping, Sequence

_WHOLE = re.compile(r"-?[0-9]{1,9}")
_REAL = re.compile(r"-?[0-9]{1,400}(?:\.[0-9]{1,400})?(?:e[+-]?[0-9]{1,3})?")
_DECISIONS = range(0, 12, 2)  # numeric splits, not categorical; missing values go left or right
_TREE = "Tree="
_END = "end of trees"


def prove_trees(text: str, *, trees: int, leaves: int, features: int) -> str:
    """Return the text of the same trees, written anew.

    Args:
        text: as LightGBM wrote it.
        trees: limit of trees, the configured number; growing may end early.
        leaves: limit per tree.
        features: number that the trees read.

    Raises:
        ValueError: naming the fault.
    """
    found = text.count(f"\n{_TREE}")
    if found > trees:
        raise ValueError(f"expected {trees:,} trees at most, as configured; found {found:,}")
    head, *blocks = text.partition(f"\n{_END}")[0].split(f"\n{_TREE}")
    said = _read_lines(head)
    if (said.get("num_class"), said.get("num_tree_per_iteration")) != ("1", "1"):
        raise ValueError("expected trees of one value")
    _whole_numbers(said, "max_feature_idx", 1, range(features - 1, features))
    proven = [
        "\n".join((f"{_TREE}{number}", *_prove(block, leaves, features), "", ""))
        for number, block in enumerate(blocks)
    ]
    lines = (
        *("tree", "version=v4", "num_class=1", "num_tree_per_iteration=1", "label_index=0"),
        *(f"max_feature_idx={features - 1}", "objective=poisson"),
        "feature_names=" + " ".join(f"Column_{number}" for number in range(features)),
        "feature_infos=" + " ".join(["none"] * features),
        "tree_sizes=" + " ".join(str(len(tree)) for tree in proven),
    )
    return "\n".join(lines) + "\n\n" + "".join(proven) + f"{_END}\n"


def _read_lines(text: str) -> dict[str, str]:
    return dict(line.split("=", 1) for line in text.split("\n") if "=" in line)


def _prove(block: str, most: int, features: int) -> Iterator[str]:
    """Yield the lines of one tree."""
    said = _read_lines(block)
    for key in ("num_cat", "is_linear"):
        if said.get(key, "0") != "0":
            raise ValueError(
                f"{key} is {said[key][:40]!r}, which is not valid in trees of this model"
            )
    (leaves,) = _whole_numbers(said, "num_leaves", 1, range(1, most + 1))
    splits = leaves - 1
    yield f"num_leaves={leaves}"
    yield "num_cat=0"
    yield _join("split_feature", _whole_numbers(said, "split_feature", splits, range(features)))
    yield _join("threshold", _real_numbers(said, "threshold", splits))
    yield _join("decision_type", _whole_numbers(said, "decision_type", splits, _DECISIONS))
    for key in ("left_child", "right_child"):
        children = _whole_numbers(said, key, splits, range(-leaves, splits))
        for split, child in enumerate(children):
            if 0 <= child <= split:
                raise ValueError(f"{key} of split {split} is {child}: it comes before its parent")
        yield _join(key, children)
    yield _join("leaf_value", _real_numbers(said, "leaf_value", leaves))
    yield "is_linear=0"
    yield "shrinkage=1"


def _whole_numbers(said: Mapping[str, str], key: str, count: int, allowed: range) -> list[int]:
    words = said.get(key, "").split()
    if len(words) != count or not all(map(_WHOLE.fullmatch, words)):
        raise ValueError(f"{key}: expected {count} whole numbers")
    numbers = [int(word) for word in words]
    if not all(number in allowed for number in numbers):
        raise ValueError(f"{key}: expected numbers of {allowed.start} to {allowed.stop - 1}")
    return numbers


def _real_numbers(said: Mapping[str, str], key: str, count: int) -> list[str]:
    """Return numbers in their original text, so that no digit changes."""
    words = said.get(key, "").split()
    if len(words) != count or not all(map(_REAL.fullmatch, words)):
        raise ValueError(f"{key}: expected {count} numbers")
    if not all(map(_is_normal, words)):
        raise ValueError(f"{key}: expected finite numbers, zero or not too small for 64 bits")
    return words


def _is_normal(word: str) -> bool:
    """Return whether a number is 0 or a normal float64; LightGBM warns of smaller ones."""
    if not re.search("[1-9]", word.partition("e")[0]):
        return True
    return sys.float_info.min <= abs(float(word)) <= sys.float_info.max


def _join(key: str, numbers: Sequence[int | str]) -> str:
    return f"{key}={' '.join(map(str, numbers))}"
