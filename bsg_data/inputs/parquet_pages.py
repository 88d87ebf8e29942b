"""What parquet unpacks to, by the header of every page: the index at its end may say less.

Arrow allots what a header says, and ends the process for some indexes that are damaged. So index
and headers are read here, before Arrow reads them: structs of Thrift's compact protocol, whose
fields have the numbers of parquet.thrift.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import Any, BinaryIO

from bsg_data.inputs.bounds import MIB

MAX_INDEX = 4 * MIB
MAX_PAGES, MAX_PAGE = 100_000, 64 * MIB  # Arrow takes a page whole
_MAX_RECORDS = 1_000_000  # structs and members of lists in an index: Arrow takes a kB for each
_MAX_HEADER = 16 * 1024  # of a page; its least and largest value are in it
_MAX_DEPTH = 16
_TAIL, _MARK = 8, b"PAR1"  # the size of the index, then the mark
_TRUE, _FALSE, _BYTE, _DOUBLE, _BINARY, _LIST, _SET, _STRUCT = 1, 2, 3, 7, 8, 9, 10, 12
_INTEGERS = (4, 5, 6)
_Struct = dict[int, Any]


def measure_pages(file: BinaryIO) -> int:
    """Return the bytes that all pages of an open parquet file say they unpack to.

    Raises:
        IndexError, KeyError, TypeError, ValueError: if its index or the header of a page cannot
            be read, or is too large.
    """
    size, pages = 0, 0
    for start, end in _list_chunks(file):
        while start < end:
            file.seek(start)
            header = _Thrift(file.read(_MAX_HEADER))
            page = header.read_struct()
            unpacked, packed = page[2], page[3]
            if not (0 <= unpacked <= MAX_PAGE and packed >= 0):
                raise ValueError(f"a page of {unpacked:,} bytes; expected 0 to {MAX_PAGE:,}")
            start += header.at + packed
            size, pages = size + unpacked, pages + 1
            if pages > MAX_PAGES:
                raise ValueError(f"more than {MAX_PAGES:,} pages; write larger ones")
    return size


def _list_chunks(file: BinaryIO) -> Iterator[tuple[int, int]]:
    """Yield where the pages of each column of each row group start and end."""
    tail = file.seek(-_TAIL, os.SEEK_END)
    size, mark = int.from_bytes(file.read(4), "little"), file.read(4)
    if mark != _MARK:
        raise ValueError("expected PAR1 at its end")
    if size > min(tail, MAX_INDEX):
        raise ValueError(f"an index of {size:,} bytes; write fewer and larger row groups")
    file.seek(tail - size)
    for group in _Thrift(file.read(size)).read_struct().get(4, []):
        for chunk in group[1]:
            column = chunk[3]
            if column[5] <= 0:  # it has no values, and no page of it is read
                continue
            start, dictionary = column[9], column.get(11, 0)
            if 0 < dictionary < start:  # as Arrow has it
                start = dictionary
            if start < 0 or start + column[7] > tail:
                raise ValueError(f"pages at {start:,} of {tail:,} bytes")
            yield start, start + column[7]


class _Thrift:
    """A reader of structs as field → value; texts are passed over."""

    def __init__(self, data: bytes) -> None:
        self._data, self.at, self._records = data, 0, 0

    def read_struct(self, depth: int = 0) -> _Struct:
        found: _Struct = {}
        field = 0
        self._count(1)
        while head := self._read_byte():
            field = field + (head >> 4) if head >> 4 else self._read_integer()
            kind = head & 15
            found[field] = kind == _TRUE if kind in (_TRUE, _FALSE) else self._read(kind, depth)
        return found

    def _read(self, kind: int, depth: int) -> Any:
        if depth > _MAX_DEPTH:
            raise ValueError(f"records nested more than {_MAX_DEPTH} deep")
        if kind in (_TRUE, _FALSE, _BYTE):  # the truth of a list takes a byte
            return self._read_byte()
        if kind in _INTEGERS:
            return self._read_integer()
        if kind in (_DOUBLE, _BINARY):
            size = 8 if kind == _DOUBLE else self._read_number()
            self.at += size
            return None
        if kind in (_LIST, _SET):
            head = self._read_byte()
            number = self._read_number() if head >> 4 == 15 else head >> 4
            self._count(number)
            return [self._read(head & 15, depth + 1) for _ in range(number)]
        if kind == _STRUCT:
            return self.read_struct(depth + 1)
        raise ValueError(f"a value of kind {kind}")  # no field of parquet.thrift is a map

    def _count(self, number: int) -> None:
        self._records += number
        if self._records > _MAX_RECORDS:
            raise ValueError(f"more than {_MAX_RECORDS:,} records in its index")

    def _read_integer(self) -> int:
        number = self._read_number()
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
        byte = self._data[self.at]
        self.at += 1
        return byte
