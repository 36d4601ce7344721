"""Equirectangular maps: orientation, solid angles, reading and repair."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813
import pytest

from relume.assets.environments.equirect import direction_to_uv, texel_directions, texel_solid_angles, uv_to_direction
from relume.assets.environments.read_environment import read_environment
from relume.core.errors import SceneError


def written(path: Path, pixels: np.ndarray) -> Path:
    height, width, channels = pixels.shape
    output = oiio.ImageOutput.create(str(path))
    assert output is not None
    assert output.open(str(path), oiio.ImageSpec(width, height, channels, oiio.FLOAT))
    assert output.write_image(np.ascontiguousarray(pixels, np.float32))
    output.close()
    return path


def test_directions_follow_the_contract() -> None:
    # u = atan2(z, x)/2π + ½: the middle column is +X, a quarter further +Z, the left edge -X; the top row is +Y.
    expected = {(0.5, 0.5): (1, 0, 0), (0.75, 0.5): (0, 0, 1), (0.25, 0.5): (0, 0, -1), (0.0, 0.5): (-1, 0, 0)}
    for (u, v), direction in expected.items():
        np.testing.assert_allclose(uv_to_direction(np.float64(u), np.float64(v)), direction, atol=1e-12)
    assert texel_directions(64, 128)[0, :, 1].min() > 0.99


def test_uv_and_direction_are_inverse() -> None:
    w = texel_directions(32, 64)
    u, v = direction_to_uv(w)
    np.testing.assert_allclose(u, np.broadcast_to((np.arange(64) + 0.5) / 64, u.shape), atol=1e-6)
    np.testing.assert_allclose(v, np.broadcast_to((np.arange(32)[:, None] + 0.5) / 32, v.shape), atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(w, axis=-1), 1, atol=1e-6)


def test_solid_angles_cover_the_sphere_and_integrate_cosines() -> None:
    solid_angle = texel_solid_angles(64, 128)
    assert solid_angle.sum() * 128 == pytest.approx(4 * np.pi, rel=1e-12)
    # ∫ max(0, n·w) dw = π for any n
    w = texel_directions(64, 128).astype(np.float64)
    for n in ([0, 1, 0], [1, 0, 0], [0.6, 0.0, 0.8], [0.48, -0.6, 0.64]):
        assert (np.maximum(w @ n, 0) * solid_angle[:, None]).sum() == pytest.approx(np.pi, rel=2e-3)


@pytest.mark.parametrize("suffix", [".hdr", ".exr"])
def test_written_maps_are_read_back(tmp_path: Path, suffix: str) -> None:
    pixels = np.random.default_rng(2).uniform(0.5, 1, (16, 32, 3)).astype(np.float32)
    pixels[3, 7] = (100, 50, 25)
    path = written(tmp_path / f"sky{suffix}", pixels)
    for source in (path, str(path), path.read_bytes()):
        environment = read_environment(source, "sky")
        assert environment.radiance.dtype == np.float32
        np.testing.assert_allclose(environment.radiance, pixels, rtol=1 / 64)
        assert environment.warnings == ()


def test_gray_and_alpha_channels_are_read(tmp_path: Path) -> None:
    gray = read_environment(written(tmp_path / "grey.exr", np.full((2, 4, 1), 0.5)), "grey")
    np.testing.assert_array_equal(gray.radiance, np.full((2, 4, 3), 0.5, np.float32))
    color = np.broadcast_to(np.array([1.0, 2.0, 3.0, 0.25]), (2, 4, 4))
    alpha = read_environment(written(tmp_path / "alpha.exr", color), "alpha")
    np.testing.assert_array_equal(alpha.radiance[0, 0], [1, 2, 3])


def test_rgb_is_found_among_other_channels(tmp_path: Path) -> None:
    spec = oiio.ImageSpec(4, 2, 5, oiio.FLOAT)
    spec.channelnames = ("A", "B", "G", "R", "Z")
    output = oiio.ImageOutput.create(str(tmp_path / "layers.exr"))
    assert output is not None
    assert output.open(str(tmp_path / "layers.exr"), spec)
    assert output.write_image(np.broadcast_to(np.array([0.5, 3, 2, 1, 9], np.float32), (2, 4, 5)).copy())
    output.close()
    np.testing.assert_array_equal(read_environment(tmp_path / "layers.exr", "layers").radiance[1, 2], [1, 2, 3])


def test_invalid_texels_are_repaired_with_one_warning_each(tmp_path: Path) -> None:
    pixels = np.ones((4, 8, 3), np.float32)
    pixels[0, 0, 1], pixels[1, 1, 0], pixels[2, 2, 2], pixels[3, 3] = np.nan, np.inf, -3.0, 1e30
    environment = read_environment(written(tmp_path / "broken.exr", pixels), "broken")
    assert len(environment.warnings) == 4
    np.testing.assert_allclose(environment.radiance[0, 0], [(1e6 + 2) / 3, 1, 1], rtol=1e-6)  # of three neighbors
    np.testing.assert_array_equal(environment.radiance[1, 1], [1e6, 1, 1])
    np.testing.assert_array_equal(environment.radiance[2, 2], [1, 1, 0])
    np.testing.assert_array_equal(environment.radiance[3, 3], 1e6)
    assert (environment.radiance == 1).sum() == 4 * 8 * 3 - 6
    assert "1 NaN texels of environment “broken” were replaced by the mean of their neighbors." in environment.warnings


@pytest.mark.parametrize("shape", [(4, 4, 3), (8, 4, 3), (4, 7, 3)])
def test_aspect_ratios_other_than_two_to_one_are_rejected(tmp_path: Path, shape: tuple[int, int, int]) -> None:
    with pytest.raises(SceneError, match="not 2:1"):
        read_environment(written(tmp_path / "odd.exr", np.random.default_rng(0).uniform(0, 1, shape)), "odd")


def test_black_maps_are_rejected(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="black everywhere"):
        read_environment(written(tmp_path / "black.exr", np.zeros((2, 4, 3))), "black")


def test_a_map_without_any_number_is_not_called_black(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="no texel of environment 'lost' is a number"):
        read_environment(written(tmp_path / "lost.exr", np.full((2, 4, 3), np.nan)), "lost")


def test_truncated_maps_show_their_complete_rows(tmp_path: Path) -> None:
    noise = np.random.default_rng(1).uniform(0.5, 1, (64, 128, 3)).astype(np.float32)
    for suffix in (".hdr", ".exr"):
        data = written(tmp_path / f"cut{suffix}", noise).read_bytes()
        complete = read_environment(data, "cut").radiance
        environment = read_environment(data[: len(data) // 2], "cut")
        num_rows = int(environment.radiance.any(axis=(1, 2)).sum())
        assert 16 <= num_rows <= 32
        np.testing.assert_array_equal(environment.radiance[:num_rows], complete[:num_rows])
        assert f"{64 - num_rows} of its 64 rows were made black" in environment.warnings[0]


def test_real_environments_are_read(shared_data: Path) -> None:
    files = [path for path in sorted((shared_data / "envmaps").rglob("*")) if path.suffix in (".hdr", ".exr")]
    assert files
    for path in files:
        environment = read_environment(path, path.stem)
        assert environment.warnings == (), path
        assert environment.radiance.mean() > 0.01


def test_maps_wider_than_requested_are_downsampled_with_a_warning(tmp_path: Path) -> None:
    """They are read in strips; repaired texels are counted over all strips."""
    pixels = np.random.default_rng(3).uniform(0, 9, (192, 384, 3)).astype(np.float32)
    pixels[[3, 150], 7], pixels[[4, 70, 190], 9] = np.nan, -1
    path = written(tmp_path / "sky.exr", pixels)
    repaired = np.maximum(pixels, 0)
    for row in (3, 150):
        repaired[row, 7] = np.nanmean(repaired[row - 1 : row + 2, 6:9], axis=(0, 1))
    for width, said in ((96, "96×48"), (150, "150×75")):
        environment = read_environment(path, "sky", width)
        assert environment.radiance.mean() == pytest.approx(repaired.mean(), rel=5e-3)
        assert environment.warnings == (
            "2 NaN texels of environment “sky” were replaced by the mean of their neighbors.",
            "3 negative texels of environment “sky” were set to 0.",
            f"Environment “sky” was scaled from 384×192 to {said}.",
        )
    quarter = read_environment(path, "sky", 96).radiance
    np.testing.assert_allclose(quarter, repaired.reshape(48, 4, 96, 4, 3).mean(axis=(1, 3)), rtol=1e-5)
    assert len(read_environment(path, "sky").warnings) == 2
