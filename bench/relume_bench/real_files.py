"""assets.rmse: real files, imported and baked, against Mitsuba with an independent reader.

Each file, from its own camera or from `front`, lit by a real map and its own emitters, with method `gather`. The peer's
scene is made from the file's bytes by `relume_bench.gltf_plain` and `relume_bench.plain_materials`, with the BRDF of
the specification (`relume_bench.peer_mitsuba_gltf`) and the peer's own dielectrics; neither importer nor terms are
shared. Errors are over pixels on surfaces; the value is the median over the files, each is in the context.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.assets.environments.read_environment import read_environment
from relume.camera.view_samples import BACKGROUND
from relume.core.cache import Cache
from relume.live.opened.openers import open_transfer
from relume.look import validate
from relume.output.render_image import render_image
from relume.scene.model import Scene
from relume.scene_io.import_scene import import_scene
from relume.store.bake_protocol import Recipe
from relume_bench.figure import Figure, skipped
from relume_bench.gather import bake
from relume_bench.gltf_plain import File, read_plain
from relume_bench.indirect import PASSES
from relume_bench.mitsuba import averaged, missing, read_passes, render_arrays
from relume_bench.plain_materials import Materials
from relume_bench.scenes import environments, shared_data
from relume_bench.standard_error import NoiseCorrectedError, compare_with_passes

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_NAME, _UNIT = "assets.rmse", "relative RMSE"
_SIZE, _FINER, _SPP, _LIGHTS = (320, 240), 2, 32, 2000
_DEPTH = 24
_CANDELA = 1 / 683  # as in importers: W/sr
FILES = {
    "cat": "scenes/egyptian-cat/cat.glb",
    "data_folder": "scenes/data_folder/data_folder.glb",
    "truck": "scenes/khronos_CesiumMilkTruck.glb",
    "sofa": "scenes/khronos_GlamVelvetSofa.glb",
    "chair": "scenes/khronos_SheenChair.glb",
    "kitchen": "scenes/luxcore_kitchen_gltf/kitchen.glb",
    "chess": "scenes/openchessset_gltf/chess_set.gltf",
    "box": "scenes/bevy_cornell_box.glb",
    "tea set": "scenes/drake_living_room/assets/tea_set_posed.gltf",
    "shader ball": "scenes/materialx_shaderball.glb",
    "coats": "conformance/khronos_material_tests/ClearCoatTest.glb",
    "attenuation": "conformance/khronos_material_tests/AttenuationTest.glb",
    "blend": "conformance/gltf_asset_generator_0.6/Material_AlphaBlend/Material_AlphaBlend_05.gltf",
    "vertex colors": "conformance/gltf_transform/BoxVertexColors.glb",
}


def measure(tiny: bool) -> list[Figure]:
    """A bake and a render of each file."""
    if (why := missing()) is not None:
        return skipped((_NAME,), _UNIT, why)
    if not all((shared_data() / path).is_file() for path in FILES.values()):
        return skipped(
            (_NAME,), _UNIT, "the real files are not there; bench/relume_bench/scenes.py describes their location"
        )
    file_names = list(FILES)[-1:] if tiny else list(FILES)
    comparisons = {name: compare_with_passes(*compared(name, tiny)) for name in file_names}
    # an error below the peer's noise counts as its upper bound
    errors = {
        name: comparison.error.value if comparison.is_significant else comparison.limit
        for name, comparison in comparisons.items()
    }
    middle = sorted(errors, key=lambda name: errors[name])[len(errors) // 2]
    context = {
        **{name: _describe(comparison) for name, comparison in comparisons.items()},
        "size": list(_SIZE),
        "spp": PASSES * _SPP,
    }
    median = float(np.median(list(errors.values())))
    return [Figure(_NAME, median, _UNIT, {**context, "lights": _LIGHTS}, comparisons[middle].error.standard_error)]


def _describe(comparison: NoiseCorrectedError) -> str:
    if not comparison.is_significant:
        return f"below {100 * comparison.limit:.0f} % (bias {100 * comparison.bias.value:.1f} %)"
    return f"{comparison.summary} ± {100 * comparison.error.standard_error:.2g} %"


def compared(name: str, tiny: bool, folder: Path | None = None) -> tuple[F64, F32]:
    """Our image and the peer's passes of one file, pixels on surfaces. (1, n, 3), (passes, 1, n, 3)

    Args:
        name: name in `FILES`. tiny: a trial run.
        folder: for whole images, in NAME.npz; None: not stored.
    """
    size, spp, lights = ((40, 30), 2, 60) if tiny else (_SIZE, _SPP, _LIGHTS)
    path = shared_data() / FILES[name]
    scene = import_scene(path, name, _light())
    with tempfile.TemporaryDirectory() as scratch:
        rendered, is_surface = _render_relume(scene, size, lights, Path(scratch))
        reference_passes = _render_mitsuba(read_plain(path), scene, size, spp, Path(scratch))
    if folder is not None:
        np.savez(folder / f"{name}.npz", ours=rendered, theirs=reference_passes, is_surface=is_surface)
    return rendered[is_surface][None], reference_passes[:, is_surface][:, None]


def _light() -> Any:
    path = shared_data() / "envmaps" / "polyhaven_studio_small_03_1k.hdr"
    return read_environment(path, path.stem) if path.is_file() else environments()[0]


def _render_relume(scene: Scene, size: tuple[int, int], lights: int, folder: Path) -> tuple[F64, NDArray[np.bool_]]:
    """The image, and the mask of pixels on surfaces."""
    width, height = size
    recipe = Recipe("gather", (scene.cameras[0].name,), (_FINER * width, _FINER * height), lights)
    transfer = open_transfer(bake(scene, recipe, folder / "gather.zarr").path, Cache(4 << 30))
    view = scene.cameras[0].name
    fine = render_image(transfer, view, validate({}, transfer.default_look))
    is_surface = transfer.views[view].material_ids() != BACKGROUND
    return averaged(fine, _FINER), is_surface.reshape(height, _FINER, width, _FINER).any(axis=(1, 3))


def _render_mitsuba(file: File, scene: Scene, size: tuple[int, int], spp: int, folder: Path) -> F32:
    materials, arrays, bsdfs = Materials(file), dict[str, Any](), []
    for k, shape in enumerate(file.shapes):
        attributes, num = shape.attributes, len(shape.attributes["POSITION"])
        arrays |= {
            f"positions_{k}": attributes["POSITION"],
            f"normals_{k}": attributes["NORMAL"],
            f"faces_{k}": shape.faces,
        }
        arrays[f"uvs_{k}"] = attributes.get("TEXCOORD_0", np.zeros((num, 2), np.float32))
        if "TANGENT" in attributes:
            arrays |= {
                f"tangent_of_{k}": attributes["TANGENT"][:, :3] * 0.5 + 0.5,
                f"hand_of_{k}": attributes["TANGENT"][:, 3:] * 0.5 + 0.5,
            }
        if "COLOR_0" in attributes:
            arrays[f"colors_of_{k}"] = np.ascontiguousarray(attributes["COLOR_0"][:, :3])
        bsdfs.append(materials.bsdf(shape.material, attributes))
    job = {
        "integrator": {"type": "volpath", "max_depth": _DEPTH}, "spp": [spp], "passes": PASSES, "bsdfs": bsdfs,
        "emitters": [emitter for attributes, to_world in file.lights for emitter in _emitter(attributes, to_world)],
    }  # fmt: skip
    render_arrays({**arrays, **materials.arrays}, scene, size, job, folder)
    return read_passes(folder)


def _emitter(light: dict[str, Any], to_world: F64) -> list[dict[str, Any]]:
    """A light of KHR_lights_punctual."""
    gain = [_CANDELA * light.get("intensity", 1.0) * c for c in light.get("color", [1, 1, 1])]
    spectrum = {"type": "rgb", "value": gain}
    if light["type"] == "point":
        return [{"type": "point", "position": to_world[:3, 3].tolist(), "intensity": spectrum}]
    if light["type"] == "directional":
        return [{"type": "directional", "direction": (-to_world[:3, 2]).tolist(), "irradiance": spectrum}]
    raise ValueError(f"{light['type']} lights are not in these files")
