"""Put a software bill of materials into the wheel: `.dist-info/sboms/` (PEP 770), CycloneDX 1.6.

It lists what `pyproject.toml` asks for, with the ranges of versions: what is installed follows from
them. It has no time and no random number, so that the same sources give the same bytes. All else of
the build is in pyproject.toml; setuptools has no setting for this.
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

from setuptools import setup
from setuptools.command.bdist_wheel import bdist_wheel

SBOM = "sboms/bom.cdx.json"


class WheelWithBill(bdist_wheel):
    """A wheel whose metadata hold the bill of materials."""

    def write_wheelfile(self, wheelfile_base: str, *more: str) -> None:
        """Write WHEEL into the folder of metadata, and the bill below it."""
        super().write_wheelfile(wheelfile_base, *more)
        path = Path(wheelfile_base, SBOM)
        path.parent.mkdir(exist_ok=True)
        bill = json.dumps(make_bill(self.distribution), indent=1)  # noqa: TID251 - it has no number
        path.write_text(f"{bill}\n", "utf-8")


def make_bill(project: Any) -> dict[str, Any]:
    """Return the bill of materials of a distribution, as CycloneDX has it."""
    wanted = [(line, "required") for line in project.install_requires]
    for extra, lines in project.extras_require.items():
        wanted += [(line, extra) for line in lines]
    name, version = project.get_name(), project.get_version()
    root = {
        "type": "application",
        "bom-ref": f"pkg:pypi/{name}@{version}",
        "name": name,
        "version": version,
        "purl": f"pkg:pypi/{name}@{version}",
        "licenses": [{"license": {"id": "Apache-2.0"}}],
    }
    parts = [_describe(line, of) for line, of in wanted if not line.startswith(name)]
    return {
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "version": 1,
        "metadata": {"component": root, "lifecycles": [{"phase": "build"}]},
        "components": parts,
        "dependencies": [
            {"ref": root["bom-ref"], "dependsOn": sorted(part["bom-ref"] for part in parts)}
        ],
    }


def _describe(line: str, of: str) -> dict[str, Any]:
    """Return the component that a requirement asks for; `of` is the extra that has it."""
    wanted, _, marker = (part.strip() for part in line.partition(";"))
    name = re.split(r"[<>=!~\[ ]", wanted)[0]
    extra = [{"name": "python:marker", "value": marker}] if marker else []
    return {
        "type": "library",
        "bom-ref": f"{of}:{line}",
        "name": name,
        "purl": f"pkg:pypi/{name.lower().replace('_', '-')}",
        "scope": "required" if of == "required" else "optional",
        "properties": [
            {"name": "python:requirement", "value": wanted},
            {"name": "python:extra", "value": "" if of == "required" else of},
            *extra,
        ],
    }


setup(cmdclass={"bdist_wheel": WheelWithBill})
