"""Small geometries that files hold."""

import numpy as np
import pytest

from relume.assets.btf.direction_rings import directions, interpolation_weights_numpy, polar, ubo_grid
from relume.core.errors import ParameterError, SceneError
from relume.synthetic_btf.corduroy import corduroy
from relume.synthetic_btf.from_mesh import read_tile
from relume.synthetic_btf.render import TileGeometry
from relume.synthetic_btf.synthesize import MESH, SyntheticBtf, synthesize_btf

LIBRARY = "newmtl red\nKd 0.6 0.1 0.1\nKs 0 0 0\nillum 1\nnewmtl green\nKd 0.1 0.5 0.2\nKs 0 0 0\nillum 1\n"


def quad(first, low, high, depth, material):
    """A piece of the plane y = 0, seen from above."""
    corners = [(low, depth), (high, depth), (high, -depth), (low, -depth)]
    places = "".join(f"v {x} 0 {z}\n" for x, z in corners)
    return f"{places}usemtl {material}\nf {first} {first + 1} {first + 2} {first + 3}\n"


@pytest.fixture
def striped(tmp_path):
    """Two metres of it, red on the left, green on the right."""
    (tmp_path / "m.mtl").write_text(LIBRARY)
    path = tmp_path / "striped.obj"
    path.write_text("mtllib m.mtl\n" + quad(1, -1, 0, 1, "red") + quad(5, 0, 1, 1, "green"))
    return path


def test_every_material_of_a_flat_mesh_sends_what_it_would_alone(striped):
    tile = read_tile(striped, None)
    seen = TileGeometry(tile, ubo_grid(), (8, 8), 1, 1).get_view(30).reshape(81, 8, 8, 3)
    sums = [sum(np.array(term["color"]) for term in terms if term["model"] == "lambert") for terms in tile.materials]
    for half, matt in zip((seen[:, :, :4], seen[:, :, 4:]), sums, strict=True):
        assert matt.max() > 0.3
        expected = matt / np.pi * directions(ubo_grid())[:, None, None, 2:]
        # lamps are wide, and a mirror's share of what is not matt comes on top
        np.testing.assert_allclose(half.mean(axis=(1, 2)), expected[:, 0, 0], rtol=0.15, atol=0.02)
    assert seen[:, :, :4, 0].mean() > 2 * seen[:, :, 4:, 0].mean()


def test_between_its_directions_light_is_neither_lost_nor_won(striped):
    """A matt surface sends the same share of light from everywhere: means of what it sends at directions are less."""
    albedo, rings = 0.5, ubo_grid()
    matt = read_tile(striped, None)._replace(materials=(({"model": "lambert", "color": [albedo] * 3},),) * 2)
    seen = TileGeometry(matt, rings, (8, 8), 3, 1).get_view(30).mean(axis=(1, 2), dtype=np.float64)
    k = np.arange(4000)
    lights = polar(np.arccos(1 - (k + 0.5) / len(k)), k * np.pi * (3 - 5**0.5))
    index, weight, left = interpolation_weights_numpy(rings, lights)
    assert (weight * seen[index]).sum(axis=1) @ left == pytest.approx(albedo / np.pi * lights[:, 2].sum(), rel=2e-3)


def test_a_file_holds_the_same_period(tmp_path):
    tile = corduroy()
    rows = [f"v {3 * x} {3 * z} {-3 * y}\n" for x, y, z in tile.positions]
    rows += [f"vn {x} {z} {-y}\n" for x, y, z in tile.normals]
    rows += ["f " + " ".join(f"{k}//{k}" for k in face + 1) + "\n" for face in tile.faces]
    path = tmp_path / "cords.obj"
    path.write_text("".join(rows))
    found = read_tile(path, 3.0)
    for name in ("positions", "normals"):
        one, other = (getattr(each, name)[each.faces] for each in (found, tile))
        np.testing.assert_allclose(one, other, atol=2e-6)


@pytest.mark.parametrize(
    ("text", "period", "error", "said"),
    [
        (quad(1, 0, 2, 1, "x") + quad(5, 2, 3, 1, "x"), None, ParameterError, "3 × 2 meters"),
        (quad(1, 0, 2, 1, "x"), 0.5, ParameterError, "half its width, 1"),
        (quad(1, 0, 2, 1, "x"), float("nan"), ParameterError, "period"),
        ("v 0 0 0\nv 1 0 0\nv 0 5 1\nf 1 2 3\n", None, ParameterError, "height of the mesh, 5"),
        ("mtllib none.mtl\n", None, SceneError, "triangles"),
        ("", None, SceneError, "empty"),
    ],
)
def test_meshes_that_are_no_period_are_refused(tmp_path, text, period, error, said):
    path = tmp_path / "bad.obj"
    path.write_text(text)
    with pytest.raises(error, match=said):
        synthesize_btf(
            tmp_path / "kept", SyntheticBtf(MESH, 8, 1, 0.1, path, period), "x", lambda share: None, lambda: False
        )
    assert not (tmp_path / "kept").exists()


def test_other_colours_are_another_btf(striped):
    wanted = SyntheticBtf(MESH, 8, 1, 0.1, striped)
    first = wanted.recipe(wanted.tile())
    assert first == wanted.recipe(wanted.tile())
    (striped.parent / "m.mtl").write_text(LIBRARY.replace("0.6", "0.7"))
    assert wanted.recipe(wanted.tile()) != first
