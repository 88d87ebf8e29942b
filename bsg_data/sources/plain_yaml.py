"""YAML as text, lists and mappings alone, from files of strangers."""

from __future__ import annotations

from typing import Any

import yaml


class PlainLoader(yaml.BaseLoader):  # type: ignore[misc]
    """Read YAML as text, lists and mappings alone; refuse what plain files do not need."""

    def compose_node(self, parent: Any, index: Any) -> Any:
        """Refuse aliases, with which a small file can stand for a huge one."""
        if self.check_event(yaml.AliasEvent):
            raise yaml.YAMLError(f"an alias, {self.peek_event().anchor!r}")
        return super().compose_node(parent, index)

    def construct_mapping(self, node: Any, deep: bool = False) -> Any:
        """Refuse a key that is there twice."""
        keys = [self.construct_object(key, deep=True) for key, _ in node.value]
        twice = {str(key) for key in keys if keys.count(key) > 1}
        if twice:
            raise yaml.YAMLError(f"the key {min(twice)!r} twice")
        return super().construct_mapping(node, deep)


def parse_yaml(data: bytes) -> Any:
    """Parse YAML.

    Raises:
        ValueError: if it is none, has an alias or a key twice, or is nested beyond reason.
    """
    try:
        return yaml.load(data, PlainLoader)  # noqa: S506
    except (yaml.YAMLError, ValueError, TypeError, RecursionError) as error:
        raise ValueError(f"no YAML ({' '.join(str(error).split())[:200]})") from error
