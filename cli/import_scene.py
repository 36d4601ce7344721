"""`relume import`: registers a scene."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cli.options import Data


def import_scene(
    file: Annotated[
        Path,
        typer.Argument(metavar="FILE.glb", help="A .glb, .gltf, .obj, .ply or .zip file; may name files beside it."),
    ],
    environment: Annotated[
        Path | None,
        typer.Option(metavar="FILE.hdr", help="Equirectangular light, .hdr or .exr; else the demo's studio."),
    ] = None,
    name: Annotated[str | None, typer.Option(help="What to call it; else the file's name.")] = None,
    data: Data = None,
) -> None:
    """Register a scene; print its id, what was understood, and a warning for each thing that was not."""
    from cli.house import open_bakes, open_settings
    from relume.light.environment import read_environment
    from relume.scene.importer import import_scene as read_scene
    from worker.scenes import get_scene, register_scene

    light = None if environment is None else read_environment(environment, environment.stem)
    scene = read_scene(file, name or file.stem, light)
    service = open_bakes(open_settings(data))
    try:
        record = get_scene(service.ledger, register_scene(service.data_dir, service.ledger, scene))
    finally:
        service.close()
    height, width, _ = scene.environment.radiance.shape
    typer.echo(record.id)
    typer.echo(f"  {record.num_triangles:,} triangles in {len(scene.meshes):,} meshes")
    for material in record.materials:
        typer.echo(f"  material {material['name']}: {' + '.join(str(term['model']) for term in material['terms'])}")
    typer.echo(f"  views: {', '.join(record.views)}")
    if record.variants:
        typer.echo(f"  variants: {', '.join(record.variants)}")
    typer.echo(f"  light: {scene.environment.name}, {width} × {height}")
    for warning in record.warnings:
        typer.echo(f"warning: {warning}", err=True)
