"""What parquet unpacks to, by the header of every page: the index at its end may say less.

Arrow allots what a header says, and ends the process for some indexes that are damaged. So index
and headers are read here, before Arrow reads them: structs of Thrift's compact protocol, whose
fields have the numbers of parquet.thrift. What Arrow would read in another way is refused: a field
twice or of another kind, numbers beyond their bits, pages that do not end where their column does.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from typing import Any, BinaryIO, NamedTuple

from bsg_data.inputs.bounds import MIB

MAX_INDEX = 4 * MIB
MAX_PAGES, MAX_PAGE = 100_000, 64 * MIB  # Arrow takes a page whole
MAX_HEADERS = 16 * MIB  # of all pages; that of a page takes a hundred bytes
MAX_WORDS = 16 * MIB  # of the dictionaries of a row group: each word may be in every row
MAX_COLUMNS, MAX_WIDTH = 1_000, 256  # of values of a fixed width, in bytes
_MAX_RECORDS = 1_000_000  # structs and members of lists in an index: Arrow takes a kB for each
_MAX_HEADER = 16 * 1024  # of a page; its least and largest value are in it
_MAX_DEPTH, _MAX_SCHEMA = 16, 100  # of records, and of columns in columns
_TAIL, _MARK = 8, b"PAR1"  # the size of the index, then the mark
_TRUE, _FALSE, _BYTE, _SHORT, _INT, _LONG, _DOUBLE, _TEXT, _LIST, _SET = range(1, 11)
_STRUCT = 12
_BITS = {_SHORT: 16, _INT: 32, _LONG: 64}
_DATA, _DICTIONARY, _DATA_AGAIN = 0, 2, 3  # types of pages
_REPEATS = (6, 7)  # encodings of texts by their differences and lengths, of which a page has any
_Struct = dict[int, tuple[int, Any]]  # field → kind and value; of a list, kind and members


class _Chunk(NamedTuple):
    """Where the pages of a column in a row group are."""

    start: int
    end: int
    group: int


class _Leaf(NamedTuple):
    """A column of the schema."""

    path: list[bytes]
    width: int  # of values of a fixed width


class Pages(NamedTuple):
    """What the pages of a file hold."""

    rows: int
    size: int  # in bytes, unpacked


def measure_pages(file: BinaryIO, is_read: Callable[[str], bool] = bool) -> Pages:
    """Return the rows of an open parquet file, and what the pages of columns that are read take.

    Raises:
        ValueError: if its index or the header of a page cannot be read, or is too large.
    """
    rows, chunks = _read_index(file, is_read)
    size, pages, headers, words = 0, 0, 0, Counter[int]()
    for chunk in chunks:
        for kind, header, page in _measure_chunk(file, chunk):
            size, pages, headers = size + page, pages + 1, headers + header
            words[chunk.group] += page * (kind == _DICTIONARY)
            if pages > MAX_PAGES:
                raise ValueError(f"more than {MAX_PAGES:,} pages; write larger ones")
            if headers > MAX_HEADERS:
                said = "write larger pages, without their least and largest values"
                raise ValueError(f"over {MAX_HEADERS:,} bytes of headers of pages; {said}")
    if max(words.values(), default=0) > MAX_WORDS:
        raise ValueError(f"over {MAX_WORDS:,} bytes of dictionaries; write it without them")
    return Pages(rows, size)


def _read_index(file: BinaryIO, is_read: Callable[[str], bool]) -> tuple[int, list[_Chunk]]:
    """Return the rows of a file, and where the pages of its columns are that are read."""
    tail = file.seek(-_TAIL, os.SEEK_END)
    length, mark = int.from_bytes(file.read(4), "little"), file.read(4)
    if mark != _MARK:
        raise ValueError("expected PAR1 at its end")
    if length > min(tail, MAX_INDEX):
        raise ValueError(f"an index of {length:,} bytes; write fewer and larger row groups")
    file.seek(tail - length)
    index = _Thrift(file.read(length)).read_struct()
    rows, groups = _read(index, 3, _LONG), _read_structs(index, 4)
    of_groups = [_read(group, 3, _LONG) for group in groups]
    if min(of_groups, default=0) < 0 or sum(of_groups) != rows:
        raise ValueError(f"{rows:,} rows, but {sum(of_groups):,} in its row groups")
    leaves = _list_leaves(_read_structs(index, 2))
    chunks = [
        chunk
        for number, group in enumerate(groups)
        for chunk in _list_chunks(group, number, leaves, is_read)
    ]
    for before, after in pairwise([_Chunk(0, 0, 0), *sorted(chunks), _Chunk(tail, tail, 0)]):
        if after.start < before.end:
            raise ValueError(f"pages at {after.start:,} within others, or beyond its end")
    return rows, chunks


def _list_leaves(schema: Sequence[_Struct]) -> list[_Leaf]:
    """Return the columns of a schema, a tree whose nodes say how many children follow them."""
    leaves: list[_Leaf] = []
    above: list[tuple[list[bytes], int]] = [([], 1)]  # path, and children that are still to come
    for number, element in enumerate(schema):
        while above and not above[-1][1]:
            above.pop()
        if not above:
            raise ValueError("more columns than its schema says")
        path, left = above.pop()
        above.append((path, left - 1))
        own = [*path, _read(element, 4, _TEXT)] if number else []  # the root has no name
        children = _read(element, 5, _INT) if 5 in element else 0
        if children > 0:
            above.append((own, children))
        elif number:
            leaves.append(_Leaf(own, _read(element, 2, _INT) if 2 in element else 0))
        if len(leaves) > MAX_COLUMNS or len(above) > _MAX_SCHEMA:
            raise ValueError(f"more than {MAX_COLUMNS:,} columns, or nested too deep")
    return leaves


def _list_chunks(
    group: _Struct, number: int, leaves: Sequence[_Leaf], is_read: Callable[[str], bool]
) -> Iterator[_Chunk]:
    """Yield the chunks of columns that are read, and have values, in a row group."""
    for leaf, chunk in zip(leaves, _read_structs(group, 1), strict=True):
        column, path = _read(chunk, 3, _STRUCT), leaf.path
        if _read(column, 3, _LIST) != (_TEXT, path):
            raise ValueError("columns of other names than its schema has")
        if not is_read(path[0].decode("utf-8", "replace")):
            continue
        if leaf.width > MAX_WIDTH:
            raise ValueError(f"values of {leaf.width:,} bytes; expected {MAX_WIDTH} at most")
        values, rows = _read(column, 5, _LONG), _read(group, 3, _LONG)
        if len(path) == 1 and values != rows:
            raise ValueError(f"{values:,} values of a column in {rows:,} rows")
        if values <= 0:  # no page of it is read
            continue
        start = _read(column, 9, _LONG)
        dictionary = _read(column, 11, _LONG) if 11 in column else 0
        if 0 < dictionary < start:  # as Arrow has it
            start = dictionary
        yield _Chunk(start, start + _read(column, 7, _LONG), number)


def _measure_chunk(file: BinaryIO, chunk: _Chunk) -> Iterator[tuple[int, int, int]]:
    """Yield the type of each page of a chunk, and the bytes of its header and of it, unpacked."""
    start = chunk.start
    while start < chunk.end:
        file.seek(start)
        header = _Thrift(file.read(_MAX_HEADER))
        page = header.read_struct()
        kind, unpacked, packed = (_read(page, field, _INT) for field in (1, 2, 3))
        if not (0 <= unpacked <= MAX_PAGE and packed >= 0):
            raise ValueError(f"a page of {unpacked:,} bytes; expected 0 to {MAX_PAGE:,}")
        places = {_DATA: (5, 2), _DATA_AGAIN: (8, 4)}
        if kind in places:
            inner, field = places[kind]
            if _read(_read(page, inner, _STRUCT), field, _INT) in _REPEATS:
                raise ValueError("texts in a delta encoding; write them plain")
        start += header.at + packed
        yield kind, header.at, max(unpacked, packed)
    if start != chunk.end:
        raise ValueError("pages that do not end where their column does")


def _read(struct: _Struct, field: int, kind: int) -> Any:
    """Return the value of a field that must be there, of a kind."""
    if field not in struct:
        raise ValueError(f"its field {field} is missing")
    found, value = struct[field]
    if found != kind:
        raise ValueError(f"its field {field} of kind {found}, expected {kind}")
    return value


def _read_structs(struct: _Struct, field: int) -> Sequence[_Struct]:
    """Return a list of structs."""
    kind, members = _read(struct, field, _LIST)
    if members and kind != _STRUCT:
        raise ValueError(f"a list of kind {kind}, expected {_STRUCT}")
    structs: Sequence[_Struct] = members
    return structs


class _Thrift:
    """A reader of structs."""

    def __init__(self, data: bytes) -> None:
        self._data, self.at, self._records = data, 0, 0

    def read_struct(self, depth: int = 0) -> _Struct:
        found: _Struct = {}
        field = 0
        self._count(1)
        while head := self._read_byte():
            field = field + (head >> 4) if head >> 4 else self._read_integer(_SHORT)
            if field in found:
                raise ValueError("a field twice")
            kind = head & 15
            value = kind == _TRUE if kind in (_TRUE, _FALSE) else self._read(kind, depth)
            found[field] = kind, value
        return found

    def _read(self, kind: int, depth: int) -> Any:
        if depth > _MAX_DEPTH:
            raise ValueError(f"records nested more than {_MAX_DEPTH} deep")
        if kind in (_TRUE, _FALSE, _BYTE):  # the truth of a list takes a byte
            return self._read_byte()
        if kind in _BITS:
            return self._read_integer(kind)
        if kind in (_DOUBLE, _TEXT):
            size = 8 if kind == _DOUBLE else self._read_number()
            self.at += size
            return self._data[self.at - size : self.at]
        if kind in (_LIST, _SET):
            head = self._read_byte()
            number = self._read_number() if head >> 4 == 15 else head >> 4
            self._count(number)
            return head & 15, [self._read(head & 15, depth + 1) for _ in range(number)]
        if kind == _STRUCT:
            return self.read_struct(depth + 1)
        raise ValueError(f"a value of kind {kind}")  # no field of parquet.thrift is a map

    def _count(self, number: int) -> None:
        self._records += number
        if self._records > _MAX_RECORDS:
            raise ValueError(f"more than {_MAX_RECORDS:,} records in its index")

    def _read_integer(self, kind: int) -> int:
        number = self._read_number()
        if number >> _BITS[kind]:
            raise ValueError(f"a number of more than {_BITS[kind]} bits")
        return number >> 1 ^ -(number & 1)

    def _read_number(self) -> int:
        number, shift = 0, 0
        while True:
            byte = self._read_byte()
            number |= (byte & 127) << shift
            shift += 7
            if byte < 128:
                return number
            if shift > 63:
                raise ValueError("a number of more than 64 bits")

    def _read_byte(self) -> int:
        if self.at >= len(self._data):
            raise ValueError("a record without an end")
        byte = self._data[self.at]
        self.at += 1
        return byte
