"""Write the dataset card and the Croissant description from the manifest."""

from __future__ import annotations

import hashlib
import html
from collections.abc import Iterable, Iterator
from typing import Any

import pyarrow as pa
import yaml

from bsg_data.dataset.manifest import Manifest
from bsg_data.dataset.schema import SPLITS, TABLES, describe_fields, pairs_schema
from bsg_data.files import encode_json
from bsg_data.tables import escape_markdown, format_markdown, mark_code
from bsg_data.terms import LICENCE_REF

_UNKNOWN = "unknown terms: ask whoever made it"  # of a source that is no row of the catalogue
_RECORDED = "these are recordings of what a robot saw, no ground truth: do not train on them."
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
    totals, classes = manifest.totals, manifest.class_space.classes
    lines = [
        _front_matter(manifest),
        "# 3D scene graphs of buildings",
        "",
        f"{totals.scenes:,} buildings, {totals.rooms:,} rooms, {totals.objects:,} objects, "
        f"{totals.classified:,} of them in one of {len(classes)} classes. "
        f"Built by {escape_markdown(manifest.generator)}. "
        f"{len(manifest.skipped)} scenes were skipped and "
        f"{totals.unmapped:,} objects had a name that no class map knows; `dataset.json` lists "
        "both, with the hash of every file. Metres, Z up, right-handed.",
        "",
        "## Sources",
        "",
        *_describe_sources(manifest),
        f"Classes of {mark_code(manifest.class_space.name)}, in the order of every histogram: "
        f"{', '.join(map(escape_markdown, classes))}.",
        "",
    ]
    for table, schema in _schemas(manifest).items():
        lines += [f"## {table}", "", f"{_MEANINGS[table].capitalize()}.", ""]
        lines += [*column_table(schema), ""]
    if split := manifest.split:
        ratios = " / ".join(f"{ratio:g}" for ratio in split.ratios or ())
        what = f"{split.folds} folds" if split.folds else f"{split.method} {ratios}"
        lines += [f"Split by building: {what}, seed {split.seed}.", ""]
    if pairs := manifest.pairs:
        lines += [f"Pairs: {pairs.draws} draws of the mask {pairs.mask}, seed {pairs.mask.seed}."]
    return "\n".join(lines).rstrip() + "\n"


def column_table(schema: pa.Schema) -> list[str]:
    """Return the columns of a table as the lines of a Markdown table; x, y and z share a line."""
    rows = []
    for name, kind, unit, meaning, null in describe_fields(schema):
        if name.endswith(("_y", "_z")) and f"{name[:-1]}x" in schema.names:
            continue
        if name.endswith("_x"):
            name, meaning = f"{name}`, `_y`, `_z", meaning.removesuffix(", x")
        description = f"{meaning} (null: {null})" if null else meaning
        rows.append((f"`{name}`", f"{kind}, {unit}" if unit else kind, description))
    return format_markdown(rows, header=("column", "type", "meaning"))


def write_croissant(manifest: Manifest) -> str:
    """Return the dataset as Croissant 1.0 JSON-LD (https://mlcommons.org/croissant)."""
    every = [source.terms for source in manifest.sources]
    terms, sets = (
        [entry for entry in every if entry is not None],
        list(_file_sets(manifest)),
    )
    description = {
        "@context": _CONTEXT,
        "@type": "sc:Dataset",
        "name": "belief-scene-graphs",
        "description": "3D scene graphs of buildings: rooms, objects, containment, masked pairs.",
        "conformsTo": "http://mlcommons.org/croissant/1.0",
        "version": f"{manifest.format_version}.0.0",
        "license": _one_or_all(entry.licence_url if entry else _UNKNOWN for entry in every),
        **({"url": _one_or_all(entry.homepage for entry in terms)} if terms else {}),
        **(
            {"citeAs": "; ".join(dict.fromkeys(entry.citation for entry in terms))} if terms else {}
        ),
        "distribution": [
            {
                "@type": "cr:FileSet",
                "@id": f"files/{name}",
                "name": name,
                "includes": pattern,
                "encodingFormat": "application/x-parquet",
            }
            for name, pattern, _ in sets
        ],
        "recordSet": [
            {
                "@type": "cr:RecordSet",
                "@id": f"records/{name}",
                "name": name,
                "field": list(_record_fields(name, schema)),
            }
            for name, _, schema in sets
        ],
    }
    return encode_json(description, indent=1) + "\n"


def _record_fields(table: str, schema: pa.Schema) -> Iterator[dict[str, Any]]:
    for name, _, unit, meaning, _ in describe_fields(schema):
        kind = schema.field(name).type
        repeated = pa.types.is_fixed_size_list(kind) or pa.types.is_list(kind)
        yield {
            "@type": "cr:Field",
            "@id": f"{table}/{name}",
            "name": name,
            "description": f"{meaning} [{unit}]" if unit else meaning,
            "dataType": _CROISSANT_TYPES[str(kind.value_type if repeated else kind)],
            "source": {"fileSet": {"@id": f"files/{table}"}, "extract": {"column": name}},
            **({"repeated": True} if repeated else {}),
        }


def _one_or_all(values: Iterable[str]) -> str | list[str]:
    """Return the distinct values; one that stands alone as itself."""
    distinct = list(dict.fromkeys(values))
    return distinct[0] if len(distinct) == 1 else distinct


def _describe_sources(manifest: Manifest) -> list[str]:
    """Return a table of the sources, then what a user has to know of their terms, as lines."""
    rows, paragraphs = [], []
    for source in manifest.sources:
        kind, terms = escape_markdown(source.kind), source.terms
        link, home, conditions = "unknown", "", f"the source is of {_UNKNOWN}."
        if terms is not None:
            link, home = f"[{terms.licence}]({terms.licence_url})", f"<{terms.homepage}>"
            conditions = html.escape(f"{terms.sentence} Cite: {terms.citation}.", quote=False)
        version = escape_markdown(source.version or "")
        rows.append((kind, version, mark_code(source.class_map.version), link, home))
        paragraphs += [] if source.is_complete else [f"{kind}: {_RECORDED}", ""]
        paragraphs += [f"{kind}: {conditions}", ""]
    header = ("source", "version", "class map", "licence", "homepage")
    return [*format_markdown(rows, header=header), "", *paragraphs]


def _schemas(manifest: Manifest) -> dict[str, pa.Schema]:
    """Return the schema of every table that the dataset holds."""
    pairs = pairs_schema(len(manifest.class_space.classes))
    every = {**TABLES, "splits": SPLITS, "pairs": pairs}
    return {table: schema for table, schema in every.items() if manifest.files_of(table)}


def _file_sets(manifest: Manifest) -> Iterator[tuple[str, str, pa.Schema]]:
    """Yield (name, pattern of its files, schema) of every table, and of every split's pairs."""
    for table, schema in _schemas(manifest).items():
        if table != "pairs":
            yield table, f"{table}/*.parquet", schema
            continue
        for stem in sorted({file.path.rpartition("-")[0] for file in manifest.files_of(table)}):
            yield f"pairs/{stem.split('/')[-1]}", f"{stem}-*.parquet", schema


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
    terms = [source.terms for source in manifest.sources]
    other = [entry for entry in terms if entry and entry.licence.startswith(LICENCE_REF)]
    names = (
        "unknown" if entry is None else "other" if entry in other else entry.licence.lower()
        for entry in terms
    )
    front: dict[str, Any] = {"license": _one_or_all(names)}
    if other:
        front["license_name"] = _one_or_all(
            entry.licence.removeprefix(LICENCE_REF) for entry in other
        )
        front["license_link"] = _one_or_all(entry.licence_url for entry in other)
    return front


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
