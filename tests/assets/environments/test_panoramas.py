"""Panoramas in other projections show the same radiance in each direction."""

import numpy as np
import pytest
from environment_files import write_map
from exr_builder import exr_part, write_exr

from relume.assets.environments.equirect import texel_directions
from relume.assets.environments.read_environment import read_environment
from relume.core.errors import SceneError

FACE = 48


def radiance(directions):
    """Smooth, positive and unlike in each direction; front +X, up +Y, right +Z. (…, 3)"""
    directions = directions / np.linalg.norm(directions, axis=-1, keepdims=True)
    x, y, z = np.moveaxis(directions, -1, 0)
    return np.stack([np.exp(x + 0.5 * y), np.exp(y - 0.7 * z), np.exp(z + 0.3 * x * y)], axis=-1).astype(np.float32)


def face_coordinates():
    """Coordinates of the texels of a face, from −1 to 1 rightward and downward."""
    t = (np.arange(FACE) + 0.5) / FACE * 2 - 1
    return np.meshgrid(t, t)


def openexr_faces():
    """Images of +X, −X, +Y, −Y, +Z, −Z by ImfEnvmap.h, whose front is +Z and whose left is +X."""
    right, down = face_coordinates()
    one = np.ones_like(right)
    faces = [
        (one, -down, right), (-one, -down, -right), (right, one, -down),
        (right, -one, down), (-right, -down, one), (right, -down, -one),
    ]  # fmt: skip
    return [radiance(np.stack([z, y, -x], axis=-1)) for x, y, z in faces]


def graphics_faces():
    """Images of +X, −X, +Y, −Y, +Z, −Z by table 8.19 of OpenGL 4.6, whose front is +Z and whose right is +X."""
    s, t = face_coordinates()
    one = np.ones_like(s)
    faces = [(one, -t, -s), (-one, -t, s), (s, one, t), (s, -one, -t), (s, -t, one), (-s, -t, -one)]
    return [radiance(np.stack([z, y, x], axis=-1)) for x, y, z in faces]


def cross(rows, blank=0.0):
    return np.concatenate(
        [
            np.concatenate([np.full((FACE, FACE, 3), blank, np.float32) if f is None else f for f in row], 1)
            for row in rows
        ]
    )


def horizontal_cross(blank=0.0):
    right, left, up, down, front, back = graphics_faces()
    return cross([[None, up, None, None], [left, front, right, back], [None, down, None, None]], blank)


def vertical_cross(blank=0.0):
    right, left, up, down, front, back = graphics_faces()
    turned = back[::-1, ::-1]
    return cross([[None, up, None], [left, front, right], [None, down, None], [None, turned, None]], blank)


def disk(angle_of, size=256):
    """Front −Z, right +X; angle_of: the angle from the front, from the radius."""
    t = (np.arange(size) + 0.5) / size * 2 - 1
    u, v = np.meshgrid(t, -t)
    radius, theta = np.hypot(u, v), np.arctan2(v, u)
    angle = angle_of(np.minimum(radius, 1))
    x, y, z = np.sin(angle) * np.cos(theta), np.sin(angle) * np.sin(theta), -np.cos(angle)
    return np.where(radius[..., None] <= 1, radiance(np.stack([-z, y, x], axis=-1)), np.float32(0))


def angular_map():
    """Debevec's formula: the angle is π times the radius."""
    return disk(lambda radius: np.pi * radius)


LAYOUTS = {
    "a horizontal cross of cube faces": horizontal_cross(),
    "a vertical cross of cube faces": vertical_cross(),
    "a column of six cube faces in the order of OpenEXR": np.concatenate(openexr_faces(), 0),
    "a row of six cube faces in the order of OpenEXR": np.concatenate(openexr_faces(), 1),
    "a column of six cube faces in the order of Direct3D and OpenGL": np.concatenate(graphics_faces(), 0),
    "a row of six cube faces in the order of Direct3D and OpenGL": np.concatenate(graphics_faces(), 1),
    "an angular map": angular_map(),
}


@pytest.mark.parametrize("name", LAYOUTS)
@pytest.mark.parametrize("suffix", ["exr", "hdr"])
def test_other_projections_show_the_same_radiance(tmp_path, name, suffix):
    environment = read_environment(write_map(tmp_path / f"a.{suffix}", LAYOUTS[name]), "probe")
    height, width, _ = environment.radiance.shape
    assert width == 2 * height == (512 if name == "an angular map" else 4 * FACE)
    expected = radiance(texel_directions(height, width))
    error = np.abs(environment.radiance / expected - 1)
    assert error.mean() < 0.01
    assert error.max() < 0.1
    (warning,) = environment.warnings
    rows, columns, _ = LAYOUTS[name].shape
    end = "; a mirror ball has the same shape and must be converted before" if name == "an angular map" else ""
    read = f"is {columns}×{rows}: it was read as {name} and resampled to {width}×{height}{end}."
    assert warning == f"Environment “probe” {read}"
    assert warning.severity == ("unsupported" if end else "approximated")


def test_a_mirror_ball_reflects_the_same_radiance(tmp_path):
    """An orthographic camera sees the direction at the angle θ from the front at the radius sin(θ / 2)."""
    path = write_map(tmp_path / "ball.exr", disk(lambda radius: 2 * np.arcsin(radius)))
    environment = read_environment(path, "probe", is_mirror_ball=True)
    directions = texel_directions(*environment.radiance.shape[:2])
    error = np.abs(environment.radiance / radiance(directions) - 1)
    assert error[directions[..., 0] > -0.9].max() < 0.1  # +X is the front; the back is the rim of the ball
    assert error.mean() < 0.01
    (warning,) = environment.warnings
    assert "read as a mirror ball" in warning
    assert warning.severity == "approximated"


@pytest.mark.parametrize("make", [horizontal_cross, vertical_cross])
def test_unused_cells_may_have_any_color(tmp_path, make):
    environment = read_environment(write_map(tmp_path / "a.exr", make(blank=3.0)), "probe")
    expected = radiance(texel_directions(*environment.radiance.shape[:2]))
    assert np.abs(environment.radiance / expected - 1).max() < 0.1


def test_maps_keep_their_energy(tmp_path):
    """Means over the sphere: a small sun is as bright as in the faces."""
    faces = [np.full((FACE, FACE, 3), 0.01, np.float32) for _ in range(6)]
    faces[4][20, 30] = 1_000
    environment = read_environment(write_map(tmp_path / "a.exr", np.concatenate(faces, 1)), "probe")
    right, down = face_coordinates()
    face_angles = (2 / FACE) ** 2 / (1 + right**2 + down**2) ** 1.5
    expected = 1_000 * face_angles[20, 30]
    rows = np.cos((0.5 - (np.arange(2 * FACE) + 0.5) / (2 * FACE)) * np.pi) * (np.pi / (2 * FACE)) ** 2
    actual = ((environment.radiance[..., 0] - 0.01) * rows[:, None]).sum()
    assert actual == pytest.approx(expected, rel=0.05)


def test_the_header_decides_the_order_of_cube_faces(tmp_path):
    """Faces of plain colors agree at no edge."""
    colors = np.eye(3)[[0, 1, 2, 0, 1, 2]] + [[0.1], [0.2], [0.3], [0.4], [0.5], [0.6]]
    image = np.repeat(np.repeat(colors[:, None], 8, axis=1), 8, axis=0).astype(np.float32)
    channels = dict(zip("RGB", np.moveaxis(image, -1, 0), strict=True))
    write_exr(tmp_path / "a.exr", exr_part(channels, textureformat="CubeFace Environment"))
    environment = read_environment(tmp_path / "a.exr", "probe")
    assert "in the order of OpenEXR" in environment.warnings[0]
    height, width, _ = environment.radiance.shape
    middle = environment.radiance[height // 2]
    for column, face in ((width // 2, 4), (width // 4, 0), (3 * width // 4, 1), (0, 5)):
        np.testing.assert_allclose(middle[column], colors[face], rtol=1e-5)
    np.testing.assert_allclose(environment.radiance[0, 0], colors[2], rtol=1e-5)
    np.testing.assert_allclose(environment.radiance[-1, 0], colors[3], rtol=1e-5)


@pytest.mark.parametrize("height", [127, 129])
def test_a_map_that_is_a_row_off_is_stretched(tmp_path, height):
    image = radiance(texel_directions(height, 256))
    environment = read_environment(write_map(tmp_path / "a.exr", image), "map")
    assert environment.radiance.shape == (128, 256, 3)
    np.testing.assert_allclose(environment.radiance, radiance(texel_directions(128, 256)), rtol=0.02)
    assert f"256×{height}: it was read as an equirectangular map and resampled to 256×128" in environment.warnings[0]


def test_large_panoramas_are_resampled_to_the_allowed_width(tmp_path):
    path = write_map(tmp_path / "a.exr", horizontal_cross())
    environment = read_environment(path, "probe", max_width=64)
    assert environment.radiance.shape == (32, 64, 3)
    np.testing.assert_allclose(environment.radiance, radiance(texel_directions(32, 64)), rtol=0.03)
    assert len(environment.warnings) == 1


@pytest.mark.parametrize("size", [(48, 64), (64, 48), (64, 64)])
def test_photographs_in_the_shape_of_crosses_and_probes_are_rejected(tmp_path, size):
    photograph = np.random.default_rng(0).uniform(0, 1, (*size, 3)).astype(np.float32)
    with pytest.raises(SceneError, match="not 2:1; use an equirectangular map, a cross of cube faces"):
        read_environment(write_map(tmp_path / "a.exr", photograph), "photograph")


@pytest.mark.parametrize("size", [(100, 300), (80, 130), (3, 2), (10, 10_000)])
def test_other_shapes_are_rejected(tmp_path, size):
    with pytest.raises(SceneError, match=r"not 2:1|the limit is"):
        read_environment(write_map(tmp_path / "a.exr", np.ones((*size, 3), np.float32)), "photograph")
