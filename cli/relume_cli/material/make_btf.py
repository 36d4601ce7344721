"""`relume material make-btf`: makes a synthetic BTF."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from relume_cli.options import Data
from relume_cli.terminal.printing import Json


def material_make_btf(
    geometry: Annotated[
        str,
        typer.Argument(
            metavar="weave|pebbles|corduroy|FILE",
            help="Small geometry to render; a .glb, .obj or .ply file holds one period of yours, seen from above (+Y).",
        ),
    ],
    size: Annotated[int, typer.Option(help="Texels along each side.")] = 128,
    grid: Annotated[int, typer.Option(help="Places along each side of a texel that are looked at.")] = 3,
    error: Annotated[float, typer.Option(help="Relative RMS that compression may miss.")] = 0.05,
    period: Annotated[
        float | None,
        typer.Option(help="Of a file: side of the square that repeats along x and z, metres; else the box about it."),
    ] = None,
    name: Annotated[str | None, typer.Option(help="What to call it.")] = None,
    as_json: Json = False,
    data: Data = None,
) -> None:
    """Render a small geometry from all sides, as a material.

    From 81 sides in light from 81 sides; nothing is measured. What was rendered when it is interrupted is still there
    when it is begun again.
    """
    from relume.assets.asset_store import check_name
    from relume.synthetic_btf.synthesize import GEOMETRIES, MESH, SyntheticBtf, synthesize_btf
    from relume_cli.data_folder import open_settings
    from relume_cli.interrupts import until_interrupted
    from relume_cli.material.messages import print_btf
    from relume_worker.paths import btfs_path

    file = None if geometry in GEOMETRIES or not Path(geometry).suffix else Path(geometry)
    request = SyntheticBtf(geometry if file is None else MESH, size, grid, error, file, period)
    request.check()
    asset_name = check_name(name or f"{geometry.capitalize() if file is None else file.stem} (synthetic)")
    folder = btfs_path(open_settings(data).data)
    record = until_interrupted(
        f"{geometry}, {size}×{size} texels",
        lambda progress, stopped: synthesize_btf(folder, request, asset_name, progress, stopped),
    )
    print_btf(record, as_json=as_json)
