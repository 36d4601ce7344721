"""`relume import`: import a scene."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from relume.core.import_warnings import by_severity
from relume.scene_io.import_options import LightUnit, Recenter, Unit, UpAxis
from relume_cli.companion_files import Root, open_companions
from relume_cli.options import Data, check_readable
from relume_cli.terminal.printing import Json, note, print_result

if TYPE_CHECKING:
    from relume.scene.model import Material, Scene
    from relume.scene_io.import_options import ImportOptions
    from relume_worker.ledger import Ledger


def import_scene(
    file: Annotated[
        Path | None,
        typer.Argument(
            metavar="FILE.glb", help="Scene: .glb, .gltf, .obj, .ply, .stl, .usd or .zip, with the files it references."
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
    up: Annotated[
        UpAxis | None, typer.Option(help="Axis of the file that points up. [default: as the file says]")
    ] = None,
    unit: Annotated[
        Unit | None, typer.Option(help="Unit of the file; auto guesses it from the size. [default: as the file says]")
    ] = None,
    recenter: Annotated[
        Recenter | None,
        typer.Option(help="Make positions relative to the middle; auto does so far from zero. [default: auto]"),
    ] = None,
    light_unit: Annotated[
        LightUnit | None, typer.Option(help="Unit of the file's lights. [default: as the format says]")
    ] = None,
    scene_name: Annotated[
        str | None, typer.Option(help="Name or number of the scene, of a glTF file with several.")
    ] = None,
    time: Annotated[
        float | None,
        typer.Option(help="Time of the animation: seconds, in USD its time code. [default: rest pose, or first time]"),
    ] = None,
    root: Root = None,
    as_json: Json = False,
    data: Data = None,
) -> None:
    """Import a scene; print its id.

    Prints a warning for each feature that was not read: "unsupported" is missing or differs from the file,
    "approximated" looks much the same, "ignored" does not change the image. --up, --unit, --recenter, --light-unit,
    --scene-name and --time are remembered: the next import of a scene with this name has them unless others are given.
    """
    from relume.scene.shadow_catcher_ground import with_ground
    from relume_cli.data_folder import open_bakes, open_settings
    from relume_cli.terminal.documents import scene_document
    from relume_worker.scenes import get_scene, register_scene

    options_given = {"up": up, "unit": unit, "recenter": recenter, "light_unit": light_unit, "scene_name": scene_name}
    options_given["time"] = None if time is None else str(time)
    given = {key: value for key, value in options_given.items() if value is not None}
    if built_in is not None and given:
        from relume.core.errors import ParameterError

        raise ParameterError("--built-in", built_in, "it without the options of files")
    service = open_bakes(open_settings(data))
    try:
        options = None if built_in or file is None else _options(service.ledger, name or file.stem, given)
        scene = _read_scene(file, environment, name, built_in, options, root)
        scene = with_ground(scene) if ground else scene
        record = get_scene(service.ledger, register_scene(service.data_dir, service.ledger, scene))
        bakes = service.bakes(record.id)
    finally:
        service.close()
    document = scene_document(record, bakes) | _content_document(scene)
    print_result(document, record.id, as_json=as_json, details=_summary_lines(scene))
    for warning in by_severity(record.warnings):
        typer.echo(f"warning, {warning.severity}: {warning}", err=True)


def _options(ledger: Ledger, name: str, given: Mapping[str, str]) -> ImportOptions:
    """The options given, over those of the newest scene with that name."""
    from relume.scene_io.import_options import ImportOptions
    from relume_worker.scenes import last_import_options

    remembered = {key: value for key, value in last_import_options(ledger, name).items() if key not in given}
    if remembered:
        options = " ".join(f"--{key.replace('_', '-')} {value}" for key, value in remembered.items())
        note(f"as in the last import of {name}: {options}")
    return ImportOptions.model_validate({**remembered, **given})


def _content_document(scene: Scene) -> dict[str, Any]:
    """Content of an imported scene as JSON: its size in meters and m², materials with their textures, and cameras."""
    from relume.scene_io.placement import area, bounds

    low, high = bounds(scene)
    return {
        "bounds": [low.tolist(), high.tolist()],
        "area": area(scene),
        "offset": list(scene.offset),
        "import_options": scene.import_options,
        "materials": [
            {"name": material.name, "terms": list(material.terms), "textures": _texture_documents(material)}
            for material in scene.materials
        ],
        "lights": [{"name": light.name, **light.fields} for light in scene.lights],
        "cameras": [
            {"name": camera.name, "to_world": camera.to_world.tolist(), "yfov": camera.yfov, "aspect": camera.aspect}
            for camera in scene.cameras
        ],
    }


def _texture_documents(material: Material) -> dict[str, Any]:
    """Width, height and wrap modes of each texture of a material, by slot."""
    textures = dict(material.textures)
    if material.normal_map is not None:
        textures["normal_map"] = material.normal_map
    documents = {
        slot: {"size": [texture.pixels.shape[1], texture.pixels.shape[0]], "wrap": list(texture.wrap)}
        for slot, texture in textures.items()
    }
    if material.opacity is not None:
        height, width = material.opacity.alpha.shape
        documents["opacity"] = {"size": [width, height], "wrap": list(material.opacity.wrap)}
    return documents


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


def _read_scene(
    file: Path | None,
    environment: Path | None,
    name: str | None,
    built_in_name: str | None,
    options: ImportOptions | None,
    root: Path | None,
) -> Scene:
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
    with open_companions(check_readable("FILE", file), root) as companions:
        return read_scene(file, name or file.stem, light, companions, options)
