"""Surfaces emit on the same sides in a free-camera image, in a fixed view, and in the reference."""

import numpy as np
import pytest
from session_edits import make_look
from tiny_scenes import make_camera, make_tiny_scene, quad

from relume.core.cache import Cache
from relume.live.free_camera.basis.highlight_lobes import NUM_GROUPS
from relume.live.free_camera.free_camera_picture import FreeCameraPicture
from relume.live.opened.openers import open_bake
from relume.methods.registry import METHODS
from relume.output.render_image import render_image
from relume.reference import reference_image
from relume.scene.model import Material
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process

SIZE = 40, 30
CENTER = 15, 20  # row and column of a pixel of the panel
EMISSION = 4.0
FRONT, BACK = (0.2, 0.6, 2.4), (0.2, 0.6, -4.4)
FLOOR = [[-2, 0, 1], [2, 0, 1], [2, 0, -3], [-2, 0, -3]]
PANEL = [[-1, 0.01, -1], [1, 0.01, -1], [1, 1, -1], [-1, 1, -1]]  # its front faces +Z


def panel_scene(origin, *, double_sided):
    """A floor and a black panel that may emit to +Z alone, from a camera at `origin`."""
    floor = Material("Floor", ({"model": "lambert", "color": [0.7, 0.7, 0.7]},))
    panel = Material("Panel", ({"model": "lambert", "color": [0.0, 0.0, 0.0]},), double_sided=double_sided)
    camera = make_camera("front", origin, (0, 0.5, -1), 0.8)
    dark = np.full((4, 8, 3), 1e-3, np.float32)
    return make_tiny_scene(
        quad("floor", FLOOR, 0), quad("panel", PANEL, 1), camera=camera, environment=dark, materials=[floor, panel]
    )


def emitting(document):
    document["lights"]["Panel"] = {"kind": "mesh", "material": "Panel", "emission": [EMISSION] * 3}


def bake(scene, method, folder):
    recipe = Recipe(method, ("front",), SIZE, 60, **({"num_probes": 400} if method == "probes" else {}))
    return open_bake(bake_in_process(METHODS[method], scene, recipe, folder / f"{method}.zarr"), Cache(1 << 30))


@pytest.mark.parametrize("double_sided", [False, True], ids=["one side", "both sides"])
@pytest.mark.parametrize("origin", [FRONT, BACK], ids=["from the front", "from behind"])
def test_a_free_camera_shows_the_emission_of_the_fixed_view(origin, double_sided, tmp_path) -> None:
    scene = panel_scene(origin, double_sided=double_sided)
    free_bake, fixed = (bake(scene, method, tmp_path) for method in ("probes", "direct"))
    look = make_look(free_bake, emitting)
    expected = EMISSION if origin == FRONT or double_sided else 0.0
    for image in (
        render_image(free_bake, "front", look),
        render_image(fixed, "front", make_look(fixed, emitting)),
        reference_image(scene, "front", look, SIZE, 4),
    ):
        np.testing.assert_allclose(image[CENTER], expected, rtol=1e-2, atol=1e-2)


def test_shaders_know_the_emissive_sides(tmp_path) -> None:
    """The last number beside lobe, normal map and shadow catcher of each material."""
    free_bake = bake(panel_scene(FRONT, double_sided=False), "probes", tmp_path)
    picture = FreeCameraPicture(free_bake, "front")
    picture.set_look(make_look(free_bake, emitting))
    picture.advance(None)
    blocks, _ = picture.array_blocks()
    rows = blocks["materials"].make()["materials"].reshape(2, -1, 4)
    assert rows[:, NUM_GROUPS, 3].tolist() == [1, 0]
