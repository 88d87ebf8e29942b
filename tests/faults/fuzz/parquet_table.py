"""Tables of parquet as JSON, whose values can be changed one by one, and back."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from fuzz.target import NoFileError

Document = dict[str, Any]
_ODD = (AttributeError, TypeError, ValueError)  # what a document of other values leads to


def to_document(table: pa.Table) -> Document:
    """Return a table as its columns, and the metadata of its schema."""
    metadata = table.schema.metadata or {}
    return {
        "columns": {name: table[name].to_pylist() for name in table.column_names},
        "types": {},
        "metadata": {key.decode(): value.decode() for key, value in metadata.items()},
    }


def write_document(document: Any, path: Path, *, schema: pa.Schema | None = None) -> int:
    """Write the table that a document says, and return its number of rows.

    Args:
        document: `columns`, their `types` where they are others than in the schema, `metadata`.
        path: of the file.
        schema: of the columns that have no type in the document.

    Raises:
        NoFileError: if it says none.
    """
    try:
        types = document.get("types") or {}
        arrays = {
            name: _make_array(values, _find_type(name, types, schema))
            for name, values in document["columns"].items()
        }
        metadata = {
            key.encode("utf-8", "surrogatepass"): value.encode("utf-8", "surrogatepass")
            for key, value in (document.get("metadata") or {}).items()
        }
        known = {} if schema is None else {field.name: field for field in schema}
        fields = [
            known.get(name, pa.field(name, array.type)).with_type(array.type)
            for name, array in arrays.items()
        ]
        table = pa.Table.from_arrays(list(arrays.values()), schema=pa.schema(fields, metadata))
        pq.write_table(table, path, compression="none", use_dictionary=False)
    except (pa.ArrowException, ArithmeticError, LookupError, *_ODD) as error:
        raise NoFileError(f"no table: {error}") from error
    return int(table.num_rows)


def _make_array(values: Any, kind: pa.DataType | None) -> pa.Array:
    if kind is not None and pa.types.is_map(kind):  # its entries are tuples
        values = [None if row is None else [tuple(pair) for pair in row] for row in values]
    return pa.array(values, kind)


def _find_type(name: str, types: Document, schema: pa.Schema | None) -> pa.DataType | None:
    if name in types:
        return pa.type_for_alias(types[name])
    return schema.field(name).type if schema is not None and name in schema.names else None


def shrink(table: pa.Table, path: Path) -> bytes:
    """Return the bytes of a table, as few as there can be, and not packed."""
    pq.write_table(table, path, compression="none", use_dictionary=False, write_statistics=False)
    return path.read_bytes()
