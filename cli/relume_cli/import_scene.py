"""`relume import`: import a scene."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from relume.core.import_warnings import SEVERITIES
from relume_cli.options import Data, check_readable
from relume_cli.terminal.printing import Json, print_result

if TYPE_CHECKING:
    from relume.scene.model import Material, Scene


def import_scene(
    file: Annotated[
        Path | None,
        typer.Argument(
            metavar="FILE.glb", help="Scene: .glb, .gltf, .obj, .ply or .zip, with the files it references."
        ),
    ] = None,
    environment: Annotated[
        Path | None, typer.Option(metavar="FILE.hdr", help="Equirectangular .hdr or .exr file. [default: studio]")
    ] = None,
    name: Annotated[str | None, typer.Option(help="Name of the scene. [default: file name]")] = None,
    built_in: Annotated[
        str | None, typer.Option(metavar="NAME", help="Built-in scene instead of a file; see relume list built-ins.")
    ] = None,
    ground: Annotated[bool, typer.Option("--ground", help="Add a ground plane that catches shadows.")] = False,
    as_json: Json = False,
    data: Data = None,
) -> None:
    """Import a scene; print its id.

    Prints a warning for each feature that was not read: "unsupported" is missing or differs from the file,
    "approximated" looks much the same, "ignored" does not change the image.
    """
    from relume.scene.shadow_catcher_ground import with_ground
    from relume_cli.data_folder import open_bakes, open_settings
    from relume_cli.terminal.documents import scene_document
    from relume_worker.scenes import get_scene, register_scene

    scene = _read_scene(file, environment, name, built_in)
    scene = with_ground(scene) if ground else scene
    service = open_bakes(open_settings(data))
    try:
        record = get_scene(service.ledger, register_scene(service.data_dir, service.ledger, scene))
        bakes = service.bakes(record.id)
    finally:
        service.close()
    print_result(scene_document(record, bakes), record.id, as_json=as_json, details=_summary_lines(scene))
    for warning in sorted(record.warnings, key=lambda warning: SEVERITIES.index(warning.severity)):
        typer.echo(f"warning, {warning.severity}: {warning}", err=True)


def _summary_lines(scene: Scene) -> Iterator[str]:
    """Summary of an imported scene, one line each."""
    height, width, _ = scene.environment.radiance.shape
    low = [min(float(mesh.positions[:, axis].min()) for mesh in scene.meshes) for axis in range(3)]
    high = [max(float(mesh.positions[:, axis].max()) for mesh in scene.meshes) for axis in range(3)]
    sides = " × ".join(f"{b - a:.3g}" for a, b in zip(low, high, strict=True))
    num_triangles, num_meshes = sum(len(mesh.faces) for mesh in scene.meshes), len(scene.meshes)
    yield f"  {scene.name}: {num_triangles:,} triangles in {num_meshes:,} mesh{'es' if num_meshes != 1 else ''}"
    yield f"  {sides} m, +Y is up"
    for material in scene.materials:
        yield f"  material {material.name}: {', '.join(_describe_material(material))}"
    yield f"  views: {', '.join(camera.name for camera in scene.cameras)}"
    if scene.lights:
        yield f"  lights: {', '.join(light.name for light in scene.lights)}"
    if scene.variants:
        yield f"  variants: {', '.join(scene.variants)}"
    yield f"  environment: {scene.environment.name}, {width} × {height}"


def _describe_material(material: Material) -> Iterator[str]:
    """Models, textures and features of a material."""
    yield " + ".join(str(term["model"]) for term in material.terms) or "no terms"
    if material.textures:
        yield f"textures of {' and '.join(sorted(material.textures))}"
    if material.normal_map is not None:
        yield "a normal map"
    if material.opacity is not None:
        yield "alpha-tested"
    if material.glass is not None:
        yield "glass"


def _read_scene(file: Path | None, environment: Path | None, name: str | None, built_in_name: str | None) -> Scene:
    from relume.assets.environments.read_environment import read_environment
    from relume.core.errors import ParameterError, PlanError
    from relume.scene.examples.catalog import BUILT_IN, built_in
    from relume.scene_io.import_scene import import_scene as read_scene
    from relume_cli.name_lookup import match_name

    if built_in_name is not None:
        if any(argument is not None for argument in (file, environment, name)):
            raise ParameterError("--built-in", built_in_name, "it alone, because it has its own environment and name")
        return built_in(match_name(built_in_name, BUILT_IN))
    if file is None:
        raise PlanError("there is nothing to import; give a scene file, or --built-in NAME")
    if environment is not None:
        check_readable("--environment", environment)
    light = None if environment is None else read_environment(environment, environment.stem)
    return read_scene(check_readable("FILE", file), name or file.stem, light)
