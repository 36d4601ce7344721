"""BTFs of small geometries from mesh files and from images."""

import numpy as np
import pytest
from PIL import Image

from relume.assets.btf.direction_rings import directions, interpolation_weights_numpy, ubo_grid
from relume.core.color import srgb_decode
from relume.core.errors import ParameterError, SceneError
from relume.math.polar import polar
from relume.synthetic_btf.corduroy import corduroy
from relume.synthetic_btf.from_images import ReliefTile
from relume.synthetic_btf.from_mesh import read_tile
from relume.synthetic_btf.render import TileGeometry
from relume.synthetic_btf.synthesize import IMAGES, MESH, SyntheticBtf, synthesize_btf

LIBRARY = "newmtl red\nKd 0.6 0.1 0.1\nKs 0 0 0\nillum 1\nnewmtl green\nKd 0.1 0.5 0.2\nKs 0 0 0\nillum 1\n"


def quad(first, low, high, depth, material):
    """A rectangle in the plane y = 0, facing up."""
    corners = [(low, depth), (high, depth), (high, -depth), (low, -depth)]
    places = "".join(f"v {x} 0 {z}\n" for x, z in corners)
    return f"{places}usemtl {material}\nf {first} {first + 1} {first + 2} {first + 3}\n"


@pytest.fixture
def striped(tmp_path):
    """Two meters of it, red on the left, green on the right."""
    (tmp_path / "m.mtl").write_text(LIBRARY)
    path = tmp_path / "striped.obj"
    path.write_text("mtllib m.mtl\n" + quad(1, -1, 0, 1, "red") + quad(5, 0, 1, 1, "green"))
    return path


def test_each_material_of_a_flat_mesh_reflects_as_on_its_own(striped):
    tile = read_tile(striped, None)
    values = TileGeometry(tile, ubo_grid(), (8, 8), 1, 1).get_view(30).reshape(81, 8, 8, 3)
    sums = [sum(np.array(term["color"]) for term in terms if term["model"] == "lambert") for terms in tile.materials]
    for half, diffuse in zip((values[:, :, :4], values[:, :, 4:]), sums, strict=True):
        assert diffuse.max() > 0.3
        expected = diffuse / np.pi * directions(ubo_grid())[:, None, None, 2:]
        # lights have an extent, and the specular part comes on top
        np.testing.assert_allclose(half.mean(axis=(1, 2)), expected[:, 0, 0], rtol=0.15, atol=0.02)
    assert values[:, :, :4, 0].mean() > 2 * values[:, :, 4:, 0].mean()


def test_interpolated_directions_preserve_energy(striped):
    """A diffuse surface has the same albedo from all directions: means over directions are lower."""
    albedo, rings = 0.5, ubo_grid()
    diffuse = read_tile(striped, None)._replace(materials=(({"model": "lambert", "color": [albedo] * 3},),) * 2)
    values = TileGeometry(diffuse, rings, (8, 8), 3, 1).get_view(30).mean(axis=(1, 2), dtype=np.float64)
    k = np.arange(4000)
    lights = polar(np.arccos(1 - (k + 0.5) / len(k)), k * np.pi * (3 - 5**0.5))
    index, weight, left = interpolation_weights_numpy(rings, lights)
    assert (weight * values[index]).sum(axis=1) @ left == pytest.approx(albedo / np.pi * lights[:, 2].sum(), rel=2e-3)


def test_a_mesh_file_gives_the_same_tile(tmp_path):
    tile = corduroy()
    rows = [f"v {3 * x} {3 * z} {-3 * y}\n" for x, y, z in tile.positions]
    rows += [f"vn {x} {z} {-y}\n" for x, y, z in tile.normals]
    rows += ["f " + " ".join(f"{k}//{k}" for k in face + 1) + "\n" for face in tile.faces]
    path = tmp_path / "cords.obj"
    path.write_text("".join(rows))
    tile_from_file = read_tile(path, 3.0)
    for name in ("positions", "normals"):
        actual, expected = (getattr(each, name)[each.faces] for each in (tile_from_file, tile))
        np.testing.assert_allclose(actual, expected, atol=2e-6)


@pytest.mark.parametrize(
    ("text", "period", "error", "message"),
    [
        (quad(1, 0, 2, 1, "x") + quad(5, 2, 3, 1, "x"), None, ParameterError, "3 × 2 meters"),
        (quad(1, 0, 2, 1, "x"), 0.5, ParameterError, "half its width, 1"),
        (quad(1, 0, 2, 1, "x"), float("nan"), ParameterError, "period"),
        ("v 0 0 0\nv 1 0 0\nv 0 5 1\nf 1 2 3\n", None, ParameterError, "height of the mesh, 5"),
        ("mtllib none.mtl\n", None, SceneError, "triangles"),
        ("", None, SceneError, "empty"),
    ],
)
def test_meshes_that_do_not_tile_are_rejected(tmp_path, text, period, error, message):
    path = tmp_path / "bad.obj"
    path.write_text(text)
    with pytest.raises(error, match=message):
        synthesize_btf(
            tmp_path / "kept", SyntheticBtf(MESH, 8, 1, 0.1, path, period), "x", lambda fraction: None, lambda: False
        )
    assert not (tmp_path / "kept").exists()


def test_other_colors_are_another_btf(striped):
    wanted = SyntheticBtf(MESH, 8, 1, 0.1, striped)
    first = wanted.recipe(wanted.tile())
    assert first == wanted.recipe(wanted.tile())
    (striped.parent / "m.mtl").write_text(LIBRARY.replace("0.6", "0.7"))
    assert wanted.recipe(wanted.tile()) != first


def print_image(folder):
    """Eight by eight random colors, each of one texel."""
    pixels = np.random.default_rng(6).integers(0, 256, (8, 8, 3)).astype(np.uint8)
    Image.fromarray(pixels).save(folder / "print.png")
    return folder / "print.png", srgb_decode((pixels / 255).astype(np.float32)).astype(np.float64)


def test_printed_colors_multiply_a_flat_mesh_at_their_uvs(tmp_path):
    path, colors = print_image(tmp_path)
    (tmp_path / "m.mtl").write_text(f"newmtl paper\nKd 1 1 1\nKs 0 0 0\nillum 1\nmap_Kd {path.name}\n")
    corners = "v 0 0 0\nv 2 0 0\nv 2 0 -2\nv 0 0 -2\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
    (tmp_path / "paper.obj").write_text("mtllib m.mtl\n" + corners + "usemtl paper\nf 1/1 2/2 3/3 4/4\n")
    geometry = TileGeometry(read_tile(tmp_path / "paper.obj", None), ubo_grid(), (8, 8), 1, 1)
    for view in (0, 40):  # a plane has no parallax, and a matte one looks the same from everywhere
        values = geometry.get_view(view).reshape(81, 8, 8, 3)
        expected = colors / np.pi * directions(ubo_grid())[:, None, None, 2:]
        np.testing.assert_allclose(values, expected, rtol=1e-3, atol=1e-4)


def test_images_give_the_same_colors_and_heights(tmp_path):
    path, colors = print_image(tmp_path)
    flat = TileGeometry(ReliefTile(None, path, 0.02, 1.0).read(), ubo_grid(), (8, 8), 1, 1).get_view(0)
    gloss = flat.reshape(81, 8, 8, 3) - colors / np.pi * directions(ubo_grid())[:, None, None, 2:]
    assert gloss.min() > -1e-4
    assert np.ptp(gloss, axis=(1, 2, 3)).max() < 1e-3  # white, the same everywhere
    rows, columns = np.meshgrid(np.arange(32), np.arange(32), indexing="ij")
    heights = (32767 * (1 + np.sin(2 * np.pi * (columns + 0.5) / 32) * np.cos(2 * np.pi * rows / 32))).astype(np.uint16)
    Image.fromarray(heights).save(tmp_path / "bump.png")
    tile = ReliefTile(tmp_path / "bump.png", path, 0.1, 0.6).read()
    assert np.ptp(tile.positions[:, 2]) == pytest.approx(0.1, rel=0.01)
    upper_right = np.argmin(np.abs(tile.positions[:, :2] - [0.25, 0.99]).sum(axis=1))
    assert tile.positions[upper_right, 2] > 0.09  # the first row of the image is at the top
    assert tile.normals[:, 2].min() > 0.8
    relief = TileGeometry(tile, ubo_grid(), (8, 8), 1, 1)
    assert 0.05 < np.ptp(relief.height()) < 0.1
    wanted = SyntheticBtf(IMAGES, 8, 1, 0.1, images=ReliefTile(tmp_path / "bump.png", path, 0.1, 0.6))
    other = wanted._replace(images=ReliefTile(tmp_path / "bump.png", None, 0.1, 0.6))
    assert wanted.recipe(tile) == wanted.recipe(wanted.tile()) != other.recipe(other.tile())


@pytest.mark.parametrize(
    ("size", "images", "error", "message"),
    [
        ((8, 9), {}, SceneError, "square"),
        ((8, 8), {"relief": 0.0}, ParameterError, "--relief"),
        ((8, 8), {"relief": float("nan")}, ParameterError, "--relief"),
        ((8, 8), {"roughness": 0.0}, ParameterError, "--roughness"),
        (None, {}, SceneError, "damaged"),
    ],
)
def test_unusable_images_are_rejected(tmp_path, size, images, error, message):
    path = tmp_path / "bump.png"
    path.write_bytes(b"no image") if size is None else Image.new("L", size).save(path)
    values = {"height": path, "color": None, "relief": 0.02, "roughness": 0.6, **images}
    with pytest.raises(error, match=message):
        synthesize_btf(
            tmp_path / "kept", SyntheticBtf(IMAGES, 8, 1, 0.1, images=ReliefTile(**values)), "x",
            lambda fraction: None, lambda: False,
        )  # fmt: skip
    assert not (tmp_path / "kept").exists()


def test_images_of_roughness_are_rejected(tmp_path):
    path, _ = print_image(tmp_path)
    (tmp_path / "m.mtl").write_text(f"newmtl paper\nKd 1 1 1\nPr 0.5\nmap_Pr {path.name}\n")
    (tmp_path / "a.obj").write_text("mtllib m.mtl\n" + quad(1, 0, 2, 1, "paper"))
    with pytest.raises(SceneError, match="roughness"):
        read_tile(tmp_path / "a.obj", None)
