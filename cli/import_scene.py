"""`relume import`: registers a scene."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cli.options import Data

if TYPE_CHECKING:
    from relume.scene.model import Scene


def import_scene(
    file: Annotated[
        Path | None,
        typer.Argument(metavar="FILE.glb", help="A .glb, .gltf, .obj, .ply or .zip file; may name files beside it."),
    ] = None,
    environment: Annotated[
        Path | None,
        typer.Option(metavar="FILE.hdr", help="Equirectangular light, .hdr or .exr; else the demo's studio."),
    ] = None,
    name: Annotated[str | None, typer.Option(help="What to call it; else the file's name.")] = None,
    built_in: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="In place of a file: still_life, cornell_box, lamplit_cornell_box, …"),
    ] = None,
    ground: Annotated[bool, typer.Option("--ground", help="Put it on a ground, which catches its shadows.")] = False,
    data: Data = None,
) -> None:
    """Register a scene; print its id, what was understood, and a warning for each thing that was not."""
    from cli.data_folder import open_bakes, open_settings
    from relume.scene.ground import with_ground
    from worker.scenes import get_scene, register_scene

    scene = _find(file, environment, name, built_in)
    scene = with_ground(scene) if ground else scene
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


def _find(file: Path | None, environment: Path | None, name: str | None, made_by_code: str | None) -> Scene:
    from relume.environments.reading import read_environment
    from relume.errors import ParameterError
    from relume.scene.built_in import built_in
    from relume.scene.importer import import_scene as read_scene

    if made_by_code is not None:
        if any(given is not None for given in (file, environment, name)):
            raise ParameterError("--built-in", made_by_code, "alone: such a scene has its own light and name")
        return built_in(made_by_code)
    if file is None:
        raise ParameterError("FILE.glb", "nothing", "a scene file, or --built-in NAME")
    light = None if environment is None else read_environment(environment, environment.stem)
    return read_scene(file, name or file.stem, light)
