"""Links of light that is reflected by narrow lobes, and links against the reference."""

from __future__ import annotations

import numpy as np
import pytest
from exact_pictures import render_uncached
from pure_pixels import shown
from session_edits import bake_corner_scene, make_look
from tiny_scenes import make_camera, make_tiny_scene, quad

from relume.reference import reference_image
from relume.scene.model import Light, Material
from relume.scene.scene_folder import make_scene

DARK = {"intensity": 0.0}
SIZE = (40, 30)
POINT = {"kind": "point", "position": [0.3, 1.3, 0.2], "emission": [2.0, 2.0, 2.0]}


def corner_of(blue_terms):
    """A floor between two walls, with a small roof over it and an emissive quad above."""
    materials = [
        Material("Floor", ({"model": "lambert", "color": [0.7, 0.7, 0.7]},)),
        Material("Red", ({"model": "lambert", "color": [0.8, 0.1, 0.1]},)),
        Material("Blue", blue_terms),
        Material("Plate", ({"model": "lambert", "color": [0.2, 0.2, 0.2]},)),
    ]
    floor = quad("floor", [[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]], 0)
    red = quad("red", [[-1, 0, 1], [-1, 0, -1], [-1, 1.5, -1], [-1, 1.5, 1]], 1, tangent=(0, 1, 0))
    blue = quad("blue", [[-1, 0, -1], [1, 0, -1], [1, 1.5, -1], [-1, 1.5, -1]], 2)
    roof = quad("roof", [[-0.3, 0.5, 0.4], [0.3, 0.5, 0.4], [0.3, 0.5, -0.2], [-0.3, 0.5, -0.2]], 1)
    plate = quad("plate", [[0.4, 1.2, 0.6], [0.4, 1.2, 0.2], [0.8, 1.2, 0.2], [0.8, 1.2, 0.6]], 3)
    environment = np.full((16, 32, 3), 0.3, np.float32)
    environment[2:5, 16:20] = 30
    camera = make_camera("front", (1.2, 1.6, 2.2), (-0.2, 0.4, -0.3), 0.7)
    tiny = make_tiny_scene(floor, red, blue, roof, plate, camera=camera, environment=environment, materials=materials)
    light = Light("Plate", {"kind": "mesh", "material": "Plate", "emission": [6.0, 6.0, 6.0]})
    return make_scene("corner", tiny.meshes, tiny.materials, tiny.cameras, tiny.environment, lights=(light,))


DIFFUSE = ({"model": "oren_nayar", "color": [0.1, 0.2, 0.8], "params": {}},)
POLISHED = (
    {"model": "lambert", "color": [0.1, 0.1, 0.1]},
    {"model": "ggx", "color": [1.0, 1.0, 1.0], "params": {"roughness": 0.15}},
)


@pytest.fixture(scope="module")
def diffuse(tmp_path_factory):
    scene = corner_of(DIFFUSE)
    return scene, bake_corner_scene(scene, "gather", tmp_path_factory.mktemp("diffuse"))


@pytest.fixture(scope="module")
def polished(tmp_path_factory):
    return bake_corner_scene(corner_of(POLISHED), "gather", tmp_path_factory.mktemp("polished"))


def look_of(transfer, plate=None, point=None, environment=None, show="all"):
    def edit(document):
        document["lights"]["Plate"].update({"enabled": False} if plate is None else plate)
        document["lights"].update({} if point is None else {"A": POINT | point})
        document["environment"].update(DARK if environment is None else environment)
        document["background"].update({"kind": "color", "color": [0.0, 0.0, 0.0]})
        document["transport"]["show"] = show

    return make_look(transfer, edit)


def rendered(transfer, **changes):
    return render_uncached(transfer, look_of(transfer, **changes))


@pytest.mark.parametrize("names", [{"materials": ["Blue"]}, {"objects": ["floor"]}], ids=["mirror", "floor"])
@pytest.mark.parametrize("source", ["plate", "point", "environment"])
def test_parts_of_a_light_add_up_in_polished_surfaces(polished, source, names):
    parts = [rendered(polished, **{source: {"link": {mode: names}}}) for mode in ("include", "exclude")]
    unlinked = rendered(polished, **{source: {}})
    assert min(part.mean() for part in parts) > 1e-3
    if source == "plate":  # both parts show the surface of the plate itself
        emitted = rendered(polished, plate={"link": {"include": {}}})
        assert emitted.max() == pytest.approx(6, rel=1e-3)
        unlinked = unlinked + emitted
    # rays of narrow lobes are split where the picture varies most, and negative light of patches is clamped
    assert np.sqrt(np.mean((sum(parts) - unlinked) ** 2) / np.mean(unlinked**2)) < 0.01


def test_a_mirror_that_is_not_linked_still_shows_what_the_light_lights(polished):
    """The light is linked to the surface that it falls on, not to the mirror."""
    floor = {"link": {"include": {"objects": ["floor"]}}}
    blue = shown(polished, "Blue")
    assert rendered(polished, environment=floor)[blue].mean() > 0.01
    assert not rendered(polished, environment=floor, show="direct")[blue].any()


LINKS = {
    "link to the floor": {"link": {"include": {"objects": ["floor"]}}},
    "no shadow of the roof": {"shadow_link": {"exclude": {"objects": ["roof"]}}},
    "shadow of the roof alone": {
        "link": {"exclude": {"materials": ["Red"]}},
        "shadow_link": {"include": {"objects": ["roof"]}},
    },
}  # fmt: skip


@pytest.mark.parametrize("link", LINKS.values(), ids=LINKS)
@pytest.mark.parametrize("show", ["direct", "all"])
def test_linked_point_light_equals_the_reference(diffuse, link, show):
    scene, transfer = diffuse
    look = look_of(transfer, point=link, show=show)
    spp = 1 if show == "direct" else 256
    passes = [reference_image(scene, "front", look, SIZE, spp, pass_index=k, reflects=True) for k in range(2)]

    def error(image):
        """RMS error; the noise of two passes is independent, so it cancels."""
        first, second = (image - expected for expected in passes)
        return np.sqrt(abs(np.mean(first * second) / np.mean(passes[0] * passes[1])))

    assert error(render_uncached(transfer, look_of(transfer, point={}, show=show))) > 0.1
    assert error(render_uncached(transfer, look)) < (1e-3 if show == "direct" else 0.03)


def test_linked_environment_of_the_reference_lights_exactly_the_linked_surfaces(diffuse):
    scene, transfer = diffuse

    def reference(link):
        return reference_image(scene, "front", look_of(transfer, environment={"link": link}, show="direct"), SIZE, 0)

    included, excluded = (reference({mode: {"materials": ["Floor"]}}) for mode in ("include", "exclude"))
    unlinked, background = reference(None), reference({"include": {}})
    np.testing.assert_allclose(included + excluded, unlinked + background, rtol=1e-5, atol=1e-6)
    floor, red = shown(transfer, "Floor"), shown(transfer, "Red")
    assert min(included[floor].mean(), excluded[red].mean()) > 0.01
    assert not excluded[floor].any()
    assert not included[red].any()
