"""MERL files: read and written bit for bit; invalid ones are rejected."""

import math
import struct

import numpy as np
import pytest

from relume.assets.measured.merl import (
    CHANNEL_SCALE,
    FILE_BYTES,
    SHAPE,
    grid_angles,
    grid_directions,
    is_measured,
    read_merl,
    write_merl,
)
from relume.core.errors import MaterialError


@pytest.fixture(scope="module")
def file(planes, tmp_path_factory):
    path = tmp_path_factory.mktemp("merl") / "plastic.binary"
    write_merl(path, planes)
    return path


def test_the_layout_equals_the_published_files(file, planes):
    assert file.stat().st_size == FILE_BYTES == 34_992_012
    content = file.read_bytes()
    assert struct.unpack_from("<3i", content) == (90, 90, 180)
    h, d, p = 3, 40, 170
    at = 12 + 8 * (2 * math.prod(SHAPE) + p + 180 * (d + 90 * h))  # blue plane, the index of the published reader
    assert struct.unpack_from("<d", content, at)[0] == planes[2, h, d, p]


def test_a_file_is_read_and_written_bit_for_bit(file, planes, tmp_path):
    read_planes = read_merl(file)
    np.testing.assert_array_equal(read_planes, planes)
    write_merl(tmp_path / "again.binary", read_planes)
    assert (tmp_path / "again.binary").read_bytes() == file.read_bytes()
    assert [path.name for path in tmp_path.iterdir()] == ["again.binary"]


def test_half_angles_are_nonuniform_and_channels_are_scaled():
    theta_h, theta_d, phi_d = (angle.ravel() for angle in grid_angles())
    np.testing.assert_allclose(np.sqrt(theta_h / (np.pi / 2)) * 90, np.arange(90), atol=1e-12)
    assert (theta_d[45], phi_d[90]) == (pytest.approx(np.pi / 4), pytest.approx(np.pi / 2))
    np.testing.assert_allclose(CHANNEL_SCALE, [1 / 1500, 1.15 / 1500, 1.66 / 1500])


def test_directions_of_the_nodes_have_their_angles():
    wi, wo = grid_directions()
    np.testing.assert_allclose(np.linalg.norm(wi, axis=-1), 1, rtol=1e-14)
    half = (wi + wo) / np.linalg.norm(wi + wo, axis=-1, keepdims=True)
    theta_h, theta_d, phi_d = grid_angles()
    np.testing.assert_allclose(half[..., 2], np.broadcast_to(np.cos(theta_h), wi.shape[:-1]), atol=1e-12)
    np.testing.assert_allclose(np.sum(half * wi, -1), np.broadcast_to(np.cos(theta_d), wi.shape[:-1]), atol=1e-12)
    # Rusinkiewicz: the azimuth of the difference vector about the half vector; the half vector's own is zero
    across = wi[..., 1] / np.where(theta_d > 0, np.sin(theta_d), 1)
    np.testing.assert_allclose(across[:, 1:], np.broadcast_to(np.sin(phi_d), wi[:, 1:, :, 0].shape), atol=1e-12)


def damaged(file, tmp_path, change):
    content = bytearray(file.read_bytes())
    change(content)
    path = tmp_path / "bad.binary"
    path.write_bytes(content)
    return path


def put(at, form, *values):
    return lambda content: struct.pack_into(form, content, at, *values)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda content: content.clear(), "does not start"),
        (lambda content: content.__delitem__(slice(7, None)), "does not start"),
        (lambda content: content.__delitem__(slice(12, None)), "12 bytes"),
        (lambda content: content.__delitem__(slice(-1, None)), "34,992,011 bytes"),
        (lambda content: content.extend(b"\0"), "34,992,013 bytes"),
        (put(0, "<3i", 90, 90, 360), "does not start"),
        (put(0, "<3i", 1_000_000_000, 1_000_000_000, 1_000_000_000), "does not start"),
        (put(0, "<3i", -90, -90, 180), "does not start"),
        (put(12 + 8 * 12345, "<d", math.nan), "non-finite"),
        (put(12 + 8 * 12345, "<d", -math.inf), "non-finite"),
        (put(12 + 8 * 12345, "<d", 1e300), "above 1e"),
    ],
)
def test_invalid_merl_files_are_rejected(file, tmp_path, change, message):
    with pytest.raises(MaterialError, match=message):
        read_merl(damaged(file, tmp_path, change))


def test_a_huge_sparse_file_is_rejected_by_its_size(tmp_path):
    path = tmp_path / "huge.binary"
    with path.open("wb") as file:
        file.write(struct.pack("<3i", *SHAPE))
        file.truncate(1 << 40)
    with pytest.raises(MaterialError, match="1,099,511,627,776 bytes"):
        read_merl(path)


def test_a_file_without_valid_values_is_rejected(tmp_path):
    write_merl(tmp_path / "gaps.binary", np.full((3, *SHAPE), -1.0))
    with pytest.raises(MaterialError, match="no measured value"):
        read_merl(tmp_path / "gaps.binary")


def test_a_negative_value_in_one_channel_invalidates_all_channels(planes):
    changed = planes.copy()
    assert is_measured(changed)[5, 5, 5]
    changed[1, 5, 5, 5] = -0.1
    assert not is_measured(changed)[5, 5, 5]


def test_a_failed_write_leaves_the_old_file(tmp_path, planes):
    path = tmp_path / "kept.binary"
    path.write_bytes(b"before")
    with pytest.raises(ValueError, match="convert"):
        write_merl(path, "no planes")
    assert [(p.name, p.read_bytes()) for p in tmp_path.iterdir()] == [("kept.binary", b"before")]
