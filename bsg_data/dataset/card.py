"""Write the dataset card and the Croissant description from the manifest."""

from __future__ import annotations

import hashlib
import html
from collections.abc import Iterable
from typing import Any

import pyarrow as pa
import yaml

from bsg_data.dataset.manifest import Manifest
from bsg_data.dataset.schema import SPLITS, TABLES, describe_fields, pairs_schema
from bsg_data.files import encode_json
from bsg_data.tables import escape_markdown, format_markdown, mark_code
from bsg_data.terms import LICENCE_REF, Terms

_UNKNOWN = "unknown terms: ask whoever made it"  # of a source that is no row of the catalogue
_MEANINGS = {
    "scenes": "one row a building",
    "rooms": "one row a room",
    "objects": "one row an annotated object",
    "edges": "containment, and room adjacency where known",
    "splits": "the split of each building",
    "pairs": "masked input and target histograms: one row a building or room, for each draw",
}
_CROISSANT_TYPES = {
    **dict.fromkeys(("int16", "int32", "uint16", "uint8"), "sc:Integer"),
    **dict.fromkeys(("double", "float"), "sc:Float"),
    "bool": "sc:Boolean",
    "string": "sc:Text",
}


def write_card(manifest: Manifest) -> str:
    """Return the dataset card: Hugging Face front matter and Markdown."""
    totals = manifest.totals
    lines = [
        _front_matter(manifest),
        "# 3D scene graphs of buildings",
        "",
        f"{totals.scenes:,} buildings, {totals.rooms:,} rooms, {totals.objects:,} objects, "
        f"{totals.classified:,} of them in one of {len(manifest.class_space.classes)} classes. "
        f"Built by {escape_markdown(manifest.generator)}. "
        f"{len(manifest.skipped)} scenes were skipped and "
        f"{totals.unmapped:,} objects had a name that no class map knows; `dataset.json` lists "
        "both, with the hash of every file. Metres, Z up, right-handed.",
        "",
        "## Sources",
        "",
        *_source_table(manifest),
        "",
        *_describe_terms(manifest),
        f"Classes of {mark_code(manifest.class_space.name)}, in the order of every histogram: "
        + ", ".join(map(escape_markdown, manifest.class_space.classes))
        + ".",
        "",
    ]
    for table, schema in _schemas(manifest).items():
        lines += [f"## {table}", "", f"{_MEANINGS[table].capitalize()}.", ""]
        lines += [*column_table(schema), ""]
    lines += _recipe_lines(manifest)
    return "\n".join(lines).rstrip() + "\n"


def column_table(schema: pa.Schema) -> list[str]:
    """Return the columns of a table as the lines of a Markdown table; x, y and z share a line."""
    rows = []
    for name, kind, unit, meaning, null in describe_fields(schema):
        if name.endswith(("_y", "_z")) and f"{name[:-1]}x" in schema.names:
            continue
        if name.endswith("_x"):
            name, meaning = f"{name}`, `_y`, `_z", meaning.removesuffix(", x")
        told = f"{meaning} (null: {null})" if null else meaning
        rows.append((f"`{name}`", f"{kind}, {unit}" if unit else kind, told))
    return format_markdown(rows, header=("column", "type", "meaning"))


def write_croissant(manifest: Manifest) -> str:
    """Return the dataset as Croissant 1.0 JSON-LD (https://mlcommons.org/croissant)."""
    terms = [source.terms for source in manifest.sources if source.terms is not None]
    description = {
        "@context": _CONTEXT,
        "@type": "sc:Dataset",
        "name": "belief-scene-graphs",
        "description": "3D scene graphs of buildings: rooms, objects, containment, masked pairs.",
        "conformsTo": "http://mlcommons.org/croissant/1.0",
        "version": f"{manifest.format_version}.0.0",
        "license": _one_or_all(
            source.terms.licence_url if source.terms else _UNKNOWN for source in manifest.sources
        ),
        **({"url": _one_or_all(one.homepage for one in terms)} if terms else {}),
        **({"citeAs": "; ".join(dict.fromkeys(one.citation for one in terms))} if terms else {}),
        "distribution": [
            {
                "@type": "cr:FileSet",
                "@id": f"files/{name}",
                "name": name,
                "includes": pattern,
                "encodingFormat": "application/x-parquet",
            }
            for name, pattern, _ in _file_sets(manifest)
        ],
        "recordSet": [_record_set(name, schema) for name, _, schema in _file_sets(manifest)],
    }
    return encode_json(description, indent=1) + "\n"


def _one_or_all(values: Iterable[str]) -> str | list[str]:
    """Return the distinct values; one that stands alone as itself."""
    distinct = list(dict.fromkeys(values))
    return distinct[0] if len(distinct) == 1 else distinct


def _source_table(manifest: Manifest) -> list[str]:
    """Return the sources, their class maps and terms as the lines of a Markdown table."""
    rows = [
        (
            escape_markdown(source.kind),
            escape_markdown(source.version or ""),
            mark_code(source.class_map.version),
            f"[{source.terms.licence}]({source.terms.licence_url})" if source.terms else "unknown",
            f"<{source.terms.homepage}>" if source.terms else "",
        )
        for source in manifest.sources
    ]
    return format_markdown(rows, header=("source", "version", "class map", "licence", "homepage"))


def _describe_terms(manifest: Manifest) -> list[str]:
    """Return what a user has to know of each source's terms, and how to cite it."""
    lines = []
    for source in manifest.sources:
        if not source.is_complete:
            said = "these are recordings of what a robot saw, no ground truth: do not train on them"
            lines += [f"{escape_markdown(source.kind)}: {said}.", ""]
        if source.terms is None:
            lines += [f"{escape_markdown(source.kind)}: the source is of {_UNKNOWN}.", ""]
        else:
            said = f"{source.terms.sentence} Cite: {source.terms.citation}."
            lines += [f"{escape_markdown(source.kind)}: {html.escape(said, quote=False)}", ""]
    return lines


def _schemas(manifest: Manifest) -> dict[str, pa.Schema]:
    """Return the schema of every table that the dataset holds."""
    pairs = pairs_schema(len(manifest.class_space.classes))
    every = {**TABLES, "splits": SPLITS, "pairs": pairs}
    return {table: schema for table, schema in every.items() if manifest.files_of(table)}


def _file_sets(manifest: Manifest) -> list[tuple[str, str, pa.Schema]]:
    """Return (name, pattern of its files, schema) of every table, and of every split's pairs."""
    sets = []
    for table, schema in _schemas(manifest).items():
        files = [file.path for file in manifest.files_of(table)]
        if table == "pairs":
            stems = sorted({path.rpartition("-")[0] for path in files})
            sets += [
                (f"pairs/{stem.split('/')[-1]}", f"{stem}-*.parquet", schema) for stem in stems
            ]
        else:
            sets.append((table, f"{table}/*.parquet", schema))
    return sets


def _front_matter(manifest: Manifest) -> str:
    """Return YAML that lets `datasets.load_dataset(folder, table)` find the files of a table.

    The tables are one split: `train`, as is the custom there, until buildings are split; then
    `full`, because `train` must hold no test buildings, and `all` is a keyword. Its cache is keyed
    by the card and the name of the folder alone: the card has a hash of the files.
    """
    tables: dict[str, list[dict[str, str]]] = {}
    for name, pattern, _ in _file_sets(manifest):
        table, _, split = name.partition("/")
        # A split's name has no hyphen there: fold-0 is fold_0.
        split = split.replace("-", "_") or ("full" if manifest.split else "train")
        tables.setdefault(table, []).append({"split": split, "path": pattern})
    configs = [{"config_name": table, "data_files": files} for table, files in tables.items()]
    files = "".join(entry.sha256 for entry in manifest.files)
    sha256 = hashlib.sha256(files.encode()).hexdigest()
    info = [{"config_name": table, "description": f"of files {sha256}"} for table in tables]
    front = {**_name_licence(manifest), "configs": configs, "dataset_info": info}
    return f"---\n{yaml.safe_dump(front, sort_keys=False)}---\n"


def _name_licence(manifest: Manifest) -> dict[str, Any]:
    """Return the licences as the front matter names them.

    SPDX in lower case, `other` by name and link for what SPDX does not list.
    """
    names: list[str] = []
    other: list[Terms] = []
    for source in manifest.sources:
        if source.terms is None:
            names.append("unknown")
        elif source.terms.licence.startswith(LICENCE_REF):
            names.append("other")
            other.append(source.terms)
        else:
            names.append(source.terms.licence.lower())
    front: dict[str, Any] = {"license": _one_or_all(names)}
    if other:
        front["license_name"] = _one_or_all(one.licence.removeprefix(LICENCE_REF) for one in other)
        front["license_link"] = _one_or_all(one.licence_url for one in other)
    return front


def _recipe_lines(manifest: Manifest) -> list[str]:
    lines, split = [], manifest.split
    if split is not None:
        ratios = " / ".join(f"{ratio:g}" for ratio in split.ratios or ())
        what = f"{split.folds} folds" if split.folds else f"{split.method} {ratios}"
        lines += [f"Split by building: {what}, seed {split.seed}.", ""]
    if manifest.pairs is not None:
        mask = manifest.pairs.mask
        lines += [f"Pairs: {manifest.pairs.draws} draws of the mask {mask}, seed {mask.seed}."]
    return lines


def _record_set(table: str, schema: pa.Schema) -> dict[str, Any]:
    fields = []
    for name, _, unit, meaning, _ in describe_fields(schema):
        kind = schema.field(name).type
        repeated = pa.types.is_fixed_size_list(kind) or pa.types.is_list(kind)
        field = {
            "@type": "cr:Field",
            "@id": f"{table}/{name}",
            "name": name,
            "description": f"{meaning} [{unit}]" if unit else meaning,
            "dataType": _CROISSANT_TYPES[str(kind.value_type if repeated else kind)],
            "source": {"fileSet": {"@id": f"files/{table}"}, "extract": {"column": name}},
        }
        fields.append({**field, "repeated": True} if repeated else field)
    return {"@type": "cr:RecordSet", "@id": f"records/{table}", "name": table, "field": fields}


# The context that Croissant 1.0 asks every description to carry.
_TERMS = (
    "citeAs column conformsTo cr data dataType equivalentProperty dct examples extract field "
    "fileObject fileProperty fileSet format includes isLiveDataset jsonPath key md5 parentField "
    "path rai recordSet references regex repeated replace samplingRate sc separator source "
    "subField transform"
)
_CONTEXT = {
    "@language": "en",
    "@vocab": "https://schema.org/",
    **{term: f"cr:{term}" for term in _TERMS.split()},
    "conformsTo": "dct:conformsTo",
    "cr": "http://mlcommons.org/croissant/",
    "data": {"@id": "cr:data", "@type": "@json"},
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
    "dct": "http://purl.org/dc/terms/",
    "examples": {"@id": "cr:examples", "@type": "@json"},
    "rai": "http://mlcommons.org/croissant/RAI/",
    "sc": "https://schema.org/",
}
