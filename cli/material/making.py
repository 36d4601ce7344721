"""`relume material make-btf`: makes a synthetic BTF."""

from __future__ import annotations

from typing import Annotated

import typer

from cli.options import Data


def material_make_btf(
    geometry: Annotated[str, typer.Argument(metavar="weave|pebbles|corduroy", help="Small geometry to render.")],
    size: Annotated[int, typer.Option(help="Texels along each side.")] = 128,
    grid: Annotated[int, typer.Option(help="Places along each side of a texel that are looked at.")] = 3,
    error: Annotated[float, typer.Option(help="Relative RMS that compression may miss.")] = 0.05,
    name: Annotated[str | None, typer.Option(help="What to call it.")] = None,
    data: Data = None,
) -> None:
    """Render a small geometry from 81 sides in light from 81 sides, and keep it as a material. Nothing is measured.

    What was rendered when it is interrupted is still there when it is begun again.
    """
    from cli.data_folder import open_settings
    from cli.interrupts import until_interrupted
    from cli.material.words import tell
    from relume.asset_store import check_name
    from relume.synthetic.make import Made, make_btf
    from worker.paths import btfs_path

    wanted = Made(geometry, size, grid, error)
    wanted.check()
    called = check_name(name or f"{geometry.capitalize()} (synthetic)")
    folder = btfs_path(open_settings(data).data)
    record = until_interrupted(
        f"{geometry}, {size}×{size} texels",
        lambda progress, stopped: make_btf(folder, wanted, called, progress, stopped),
    )
    tell(record)
