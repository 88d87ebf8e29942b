"""Read the buildings that `bsg-data synth` wrote."""

from __future__ import annotations

from pathlib import Path

from bsg_data.errors import SourceError
from bsg_data.sources.hm3d import HOMEPAGE, HM3DFolder
from bsg_data.sources.source import SourceRow, Terms


def _open_synthetic(
    path: Path, *, meshes: bool = True, snap_colours: int | None = None
) -> HM3DFolder:
    """Open a folder of synthetic buildings."""
    folder = HM3DFolder(path, meshes=meshes, snap_colours=snap_colours)
    if path.is_dir() and folder.kind != "synthetic":
        raise SourceError(
            f"{path}: holds no buildings of `bsg-data synth`; read it as the source hm3d",
            code="source-mixed",
            where=path,
        )
    return folder


ROW = SourceRow(
    summary="a folder that `bsg-data synth` wrote",
    open=_open_synthetic,
    terms=Terms(
        licence="Apache-2.0",
        licence_url="https://www.apache.org/licenses/LICENSE-2.0",
        homepage=HOMEPAGE,
        citation="Saucedo et al., Belief Scene Graphs, ICRA 2024, arXiv:2402.03840",
        sentence="The buildings are synthetic: no building like them exists, and none was scanned.",
    ),
)
