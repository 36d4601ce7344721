"""`relume material make-btf`: render a synthetic BTF."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from relume_cli.options import Data
from relume_cli.terminal.printing import Json


def material_make_btf(
    geometry: Annotated[
        str | None,
        typer.Argument(
            metavar="[weave|pebbles|corduroy|FILE]",
            help="Geometry to render; a .glb, .obj or .ply file contains one period, +Y up.",
        ),
    ] = None,
    height: Annotated[Path | None, typer.Option(help="Instead of a geometry: image of heights, black lowest.")] = None,
    color: Annotated[Path | None, typer.Option(help="Instead of a geometry: image of colors, on the heights.")] = None,
    relief: Annotated[float, typer.Option(help="Images: height of white over black, in sides of the image.")] = 0.02,
    roughness: Annotated[float, typer.Option(help="Images: roughness of the gloss, 0.05 to 1.")] = 0.6,
    size: Annotated[int, typer.Option(help="Texels along each side.")] = 128,
    grid: Annotated[int, typer.Option(help="Samples along each side of a texel.")] = 3,
    error: Annotated[float, typer.Option(help="Relative RMS error allowed in compression.")] = 0.05,
    period: Annotated[
        float | None,
        typer.Option(help="File: side of the square that repeats along x and z, in meters. [default: bounding box]"),
    ] = None,
    name: Annotated[str | None, typer.Option(help="Name of the material.")] = None,
    as_json: Json = False,
    data: Data = None,
) -> None:
    """Render a BTF of a small geometry or of images.

    From 81 view directions under 81 light directions; nothing is measured. If it is interrupted, run it again: it
    resumes.
    """
    from relume.assets.asset_store import check_name
    from relume.core.errors import ParameterError
    from relume.synthetic_btf.from_images import ReliefTile
    from relume.synthetic_btf.synthesize import GEOMETRIES, IMAGES, MESH, SyntheticBtf, synthesize_btf
    from relume_cli.data_folder import open_settings
    from relume_cli.interrupts import until_interrupted
    from relume_cli.material.messages import print_btf
    from relume_worker.paths import btfs_path

    images = None if height is None and color is None else ReliefTile(height, color, relief, roughness)
    if (geometry is None) == (images is None):
        raise ParameterError("geometry", geometry, "either a geometry, or images by --height and --color")
    file = None if geometry is None or geometry in GEOMETRIES or not Path(geometry).suffix else Path(geometry)
    kind = IMAGES if geometry is None else geometry if file is None else MESH
    request = SyntheticBtf(kind, size, grid, error, file, period, images)
    request.check()
    source = file or color or height
    stem = kind.capitalize() if source is None else source.stem
    asset_name = check_name(name or f"{stem} (synthetic)")
    folder = btfs_path(open_settings(data).data)
    record = until_interrupted(
        f"{stem}, {size}×{size} texels",
        lambda progress, stopped: synthesize_btf(folder, request, asset_name, progress, stopped),
    )
    print_btf(record, as_json=as_json)
