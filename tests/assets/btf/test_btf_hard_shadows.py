"""BTFs beside hard-shadow lights: sharp shadows stay on all surfaces, and fall on texels too."""

import copy

import numpy as np
import pytest
from tiny_scenes import make_camera, make_tiny_scene, quad

from relume.core.cache import Cache
from relume.live.free_camera.free_camera_picture import FreeCameraPicture
from relume.live.opened.openers import open_bake
from relume.look import complete, validate
from relume.methods.registry import METHODS
from relume.output.render_image import render_image
from relume.scene.model import Material
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process

CAMERA = make_camera("front", [0.5, 2.2, 2.6], [0, 0.2, 0], 0.7)
SIZE = (96, 72)
GRAY = {"model": "lambert", "color": [0.5, 0.5, 0.5]}
SUN = {"kind": "directional", "direction": [-0.5, -1.0, -0.25], "emission": [3.0, 2.8, 2.5]}


def opened(method, folder):
    floor = quad("floor", [[-2, 0, 2], [2, 0, 2], [2, 0, -2], [-2, 0, -2]], 0)
    sheet = quad("sheet", [[-0.4, 0.7, 0.4], [0.4, 0.7, 0.4], [0.4, 0.7, -0.4], [-0.4, 0.7, -0.4]], 1)
    materials = [Material("Floor", (GRAY,)), Material("Sheet", (GRAY,))]
    environment = np.full((16, 32, 3), 0.05, np.float32)
    scene = make_tiny_scene(floor, sheet, camera=CAMERA, environment=environment, materials=materials)
    recipe = Recipe(method, ("front",), SIZE, 100, num_probes=1500)
    return open_bake(bake_in_process(METHODS[method], scene, recipe, folder / f"{method}.zarr"), Cache(1 << 30))


@pytest.fixture(scope="module")
def free_bake(tmp_path_factory):
    return opened("probes", tmp_path_factory.mktemp("free"))


def sunlit(bake, record=None, material="Floor"):
    """Direct light of a sun and the environment, with a BTF on one material."""
    document = copy.deepcopy(complete({}, bake.default_look))
    document["transport"]["show"] = "direct"
    document["lights"] = {"Sun": SUN}
    if record is not None:
        document["materials"][material]["terms"] = [{**record.terms()[0], "params": {"scale": 2.0}}]
    return validate(document, bake.default_look)


def show(bake, look):
    picture = FreeCameraPicture(bake, "front")
    picture.set_look(look)
    picture.advance(None)
    return picture


def test_a_btf_changes_no_pixel_of_other_materials(free_bake, small_btf):
    plain, with_btf = (
        show(free_bake, sunlit(free_bake)),
        show(free_bake, sunlit(free_bake, small_btf.record, "Sheet")),
    )
    gbuffer, face_material = plain.gbuffer, free_bake.stored_scene.face_material
    num_pixels, face = SIZE[0] * SIZE[1], gbuffer.hits.face
    shows_sheet = (face >= 0) & (face_material[face] == list(free_bake.material_names).index("Sheet"))
    is_covered = shows_sheet[:num_pixels].copy()
    is_covered[gbuffer.owner[shows_sheet[num_pixels:]]] = True
    before, after = (picture.image().reshape(-1, 3) for picture in (plain, with_btf))
    assert 0.02 < is_covered.mean() < 0.5
    assert np.array_equal(before[~is_covered], after[~is_covered])
    assert not np.array_equal(before[is_covered], after[is_covered])


def test_texels_in_a_sharp_shadow_are_as_dark_as_in_a_fixed_view(free_bake, small_btf, tmp_path):
    fixed = opened("direct", tmp_path)
    pictures = {record: show(free_bake, sunlit(free_bake, record)) for record in (None, small_btf.record)}
    picture, ratios = pictures[small_btf.record], []
    shadow_visibility, face = picture._previous.shadow_visibility[0], picture.gbuffer.hits.face
    visible, face = (values[: SIZE[0] * SIZE[1]].reshape(SIZE[::-1]) for values in (shadow_visibility, face))
    on_floor = (face >= 0) & (free_bake.stored_scene.face_material[face] == 0)
    in_shadow, in_sun = on_floor & (visible == 0), on_floor & (visible == 1)
    assert in_shadow.mean() > 0.03
    for record, shown in pictures.items():
        image, expected = shown.image(), render_image(fixed, "front", sunlit(fixed, record))[..., :3]
        ratios.append(image[in_shadow].mean() / expected[in_shadow].mean())
        assert image[in_shadow].mean() < 0.25 * image[in_sun].mean()
        assert np.linalg.norm((image - expected)[on_floor]) < 0.1 * np.linalg.norm(expected[on_floor])
    assert ratios[1] == pytest.approx(ratios[0], rel=0.05)  # the environment under the sheet is as coarse as for gray
