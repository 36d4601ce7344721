"""btf.moving_rmse: BTFs as a moving camera shows them, against the geometry itself.

A plane covered with the weave, the pebbles and the corduroy, under the studio and under an environment with a
sun, from four cameras between the directions of the BTFs. Compared are moving frames, with hard shadows and without
refinement, with Mitsuba's paths through the small geometry. The noise is removed.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.assets.btf.btf_store import STORE, BtfRecord
from relume.assets.environments.daylight import clear_day
from relume.assets.environments.environment import Environment
from relume.assets.environments.studio import studio
from relume.core.cache import Cache
from relume.live.free_camera.free_camera_picture import FreeCameraPicture
from relume.live.opened.openers import open_bake
from relume.look import validate
from relume.methods.registry import METHODS
from relume.scene.model import Scene
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process
from relume.synthetic_btf.synthesize import GEOMETRIES
from relume_bench.btf_pictures import make_scenes, traced_by_peer
from relume_bench.btf_synthetic import SyntheticBtf, open_values_folder
from relume_bench.figure import Figure, skipped
from relume_bench.free_camera_scene import run_light_jobs
from relume_bench.mitsuba import missing
from relume_bench.standard_error import NoiseCorrectedError, compare_with_passes

_BOUND = 0.05  # of the stored values
_ENVIRONMENTS = {"studio": studio, "clear environment": clear_day}
CAMERA_ANGLES = (22.0, 17.0), (22.0, 137.0), (52.0, 200.0), (52.0, 317.0)  # θ and φ, degrees
_NAME = "btf.moving_rmse"


def measure(tiny: bool) -> list[Figure]:
    """Make three BTFs, and compare their free-camera images with the actual geometry."""
    if (why := missing()) is not None:
        return skipped((_NAME,), "%", why)
    names = ("weave",) if tiny else ("weave", "pebbles", "corduroy")
    with (
        open_values_folder(tiny) as values_folder,
        tempfile.TemporaryDirectory() as folder,
        STORE.with_search_folder(Path(folder) / "btfs"),
    ):
        folder_path = Path(folder)
        records = {name: SyntheticBtf(name, values_folder, tiny).save(folder_path, _BOUND) for name in names}
        comparisons = {
            (name, environment): against_geometry(record, make(), folder_path / f"{name}-{environment}", tiny)
            for name, record in records.items()
            for environment, make in _ENVIRONMENTS.items()
        }
    return [_figure(comparisons)]


def _figure(comparisons: dict[tuple[str, str], list[NoiseCorrectedError]]) -> Figure:
    """The worst error, and all of them."""
    worst = max((each for row in comparisons.values() for each in row), key=lambda comparison: comparison.error.value)
    context: dict[str, Any] = {
        "from": [f"θ {theta}°, φ {phi}°" for theta, phi in CAMERA_ANGLES],
        "errors": {", ".join(key): [each.error.value for each in row] for key, row in comparisons.items()},
        "biases": {", ".join(key): [each.bias.value for each in row] for key, row in comparisons.items()},
        "median": float(np.median([each.error.value for row in comparisons.values() for each in row])),
        "noise": worst.noise,
    }  # fmt: skip
    return Figure(_NAME, 100 * worst.error.value, "%", context, 100 * worst.error.standard_error)


def against_geometry(
    record: BtfRecord, environment: Environment, folder: Path, tiny: bool
) -> list[NoiseCorrectedError]:
    """Compare free-camera images of a covered plane with the path-traced geometry, for each camera.

    Args:
        record: a BTF named like its geometry. environment: the light. folder: for stores, created. tiny: a trial run.
    """
    size, spp = ((16, 16), 2) if tiny else ((96, 96), 64)
    tile = GEOMETRIES[record.name]()
    folder.mkdir()
    plane = make_scenes(tile, environment, CAMERA_ANGLES)[0]
    images = moving_images(plane, record, size, folder / "plane.zarr", 60 if tiny else 2000)
    comparisons = []
    for number, (angles, image) in enumerate(zip(CAMERA_ANGLES, images, strict=True)):
        displaced_scene = make_scenes(tile, environment, [angles])[1]
        passes = traced_by_peer(displaced_scene, size, spp, [tile.materials[0]], folder / f"peer{number}")
        comparisons.append(compare_with_passes(image.astype(np.float64), passes))
    return comparisons


def moving_images(
    plane: Scene, record: BtfRecord, size: tuple[int, int], path: Path, lights: int
) -> list[NDArray[np.float32]]:
    """Bake a plane for a free camera, cover it, and move through its cameras.

    Args:
        plane: the scene. record: the BTF. size: of the images. path: of the store. lights: environment triangles.
    """
    recipe = Recipe("probes", (plane.cameras[0].name,), size, lights, num_probes=500)
    bake: Any = open_bake(bake_in_process(METHODS["probes"], plane, recipe, path), Cache(2 << 30))
    term = {**record.terms()[0], "color": [1.0, 1.0, 1.0]}
    picture = FreeCameraPicture(bake, plane.cameras[0].name, is_watched=True)
    picture.set_look(validate({"materials": {"Cloth": {"terms": [term]}}}, bake.default_look))
    picture.advance(None)
    run_light_jobs(picture)
    images = []
    for camera in plane.cameras:
        picture.set_camera(camera, size)
        picture.advance(None)
        images.append(picture.image())
    return images
