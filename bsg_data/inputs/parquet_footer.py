"""Read the footer of a parquet file without Arrow.

Arrow aborts the process if a column of a malformed footer is accessed. So the few numbers that are
checked before reading are taken from the bytes: the format's `FileMetaData` in Thrift's compact
protocol. https://github.com/apache/parquet-format
"""

from __future__ import annotations

import io
from dataclasses import dataclass
from typing import Any, BinaryIO

from bsg_data.inputs.bounds import MIB

MAX_FOOTER = 64 * MIB
_MAGIC = b"PAR1"
_TEXT = 6  # BYTE_ARRAY
_DEEPEST = 32  # structs and lists; those of the format have 8
_STOP, _TRUE, _FALSE, _BYTE, _DOUBLE, _BINARY, _LIST, _SET, _STRUCT = 0, 1, 2, 3, 7, 8, 9, 10, 12
_INTEGERS = (4, 5, 6)


@dataclass(frozen=True, slots=True)
class ColumnChunk:
    """A column of a row group.

    Attributes:
        path: of its names, joined by points.
        is_text: whether its values are words.
        values: entries, those of lists counted each.
        bytes: unpacked.
    """

    path: str
    is_text: bool
    values: int
    bytes: int


@dataclass(frozen=True, slots=True)
class RowGroup:
    """A row group: its rows and its columns."""

    rows: int
    columns: tuple[ColumnChunk, ...]


@dataclass(frozen=True, slots=True)
class Footer:
    """What a footer says: rows in all, and the row groups."""

    rows: int
    groups: tuple[RowGroup, ...]


def read_footer(file: BinaryIO) -> Footer:
    """Read the footer of a parquet file.

    Raises:
        ValueError: if it has none, or one that does not fit together.
        OSError: if it cannot be read.
    """
    size = file.seek(0, io.SEEK_END)
    file.seek(max(0, size - 8))
    end = file.read(8)
    length = int.from_bytes(end[:4], "little")
    if size < 12 or end[4:] != _MAGIC or length > size - 12:
        raise ValueError("it does not end as parquet does")
    if length > MAX_FOOTER:
        raise ValueError(f"its footer says {length:,} bytes; expected at most {MAX_FOOTER:,}")
    file.seek(size - 8 - length)
    try:
        said = _Reader(file.read(length)).read_struct()
        leaves = sum(5 not in element for element in said[2])  # without children
        groups = tuple(_read_group(group, leaves) for group in said[4])
        footer = Footer(_count(said[3]), groups)
    except (IndexError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise ValueError("its footer is malformed") from error
    if sum(group.rows for group in groups) != footer.rows:
        raise ValueError("its row groups have other rows than it says")
    return footer


def _read_group(said: dict[int, Any], leaves: int) -> RowGroup:
    columns = tuple(_read_column(column[3]) for column in said[1])
    if len(columns) != leaves:
        raise ValueError(f"a row group has {len(columns)} columns, expected {leaves}")
    return RowGroup(_count(said[3]), columns)


def _read_column(said: dict[int, Any]) -> ColumnChunk:
    path = ".".join(part.decode("utf-8", "replace") for part in said[3])
    return ColumnChunk(path, said[1] == _TEXT, _count(said[5]), _count(said[6]))


def _count(value: Any) -> int:
    if not isinstance(value, int) or value < 0:
        raise ValueError(f"its footer says {value!r}, expected a number of things")
    return value


class _Reader:
    """Thrift's compact protocol: structs as dictionaries by the numbers of their fields."""

    def __init__(self, data: bytes) -> None:
        self._data, self._at = data, 0

    def read_struct(self, depth: int = 0) -> dict[int, Any]:
        """Read fields up to the end of a struct."""
        fields: dict[int, Any] = {}
        number = 0
        while (head := self._byte()) & 15 != _STOP:
            number = number + (head >> 4) if head >> 4 else self._integer()
            kind = head & 15
            fields[number] = (
                kind == _TRUE if kind in (_TRUE, _FALSE) else self._value(kind, depth + 1)
            )
        return fields

    def _value(self, kind: int, depth: int) -> Any:
        if depth > _DEEPEST:
            raise ValueError("its footer is nested beyond reason")
        if kind in _INTEGERS:
            return self._integer()
        if kind == _BINARY:
            return self._take(self._varint())
        if kind == _STRUCT:
            return self.read_struct(depth)
        if kind in (_LIST, _SET):
            head = self._byte()
            size = self._varint() if head >> 4 == 15 else head >> 4
            return [self._value(head & 15, depth + 1) for _ in range(size)]
        if kind in (_TRUE, _FALSE, _BYTE):  # in a list, a byte each
            return self._byte()
        if kind == _DOUBLE:
            return self._take(8)
        raise ValueError(f"its footer has a value of the unknown kind {kind}")

    def _byte(self) -> int:
        byte = self._data[self._at]
        self._at += 1
        return byte

    def _take(self, size: int) -> bytes:
        if size > len(self._data) - self._at:
            raise ValueError("its footer is cut off")
        self._at += size
        return self._data[self._at - size : self._at]

    def _varint(self) -> int:
        value = shift = 0
        while True:
            byte = self._byte()
            value |= (byte & 127) << shift
            if byte < 128:
                return value
            shift += 7
            if shift > 63:
                raise ValueError("its footer has a number that is too long")

    def _integer(self) -> int:
        value = self._varint()
        return (value >> 1) ^ -(value & 1)
