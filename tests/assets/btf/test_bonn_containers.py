"""Containers of the Bonn BTF database: valid ones are read exactly, invalid ones are rejected."""

import struct

import numpy as np
import pytest
from btf_containers import ANGLES, SIZE, YUV_TO_RGB, container, encode_container, random_factors, values

from relume.assets.btf.direction_rings import directions
from relume.assets.btf.matrix_btf import MatrixBtf
from relume.core.errors import MaterialError
from relume_cli.main import main

LAST = len(ANGLES) - 1  # files list their directions in reverse order


def images(path):
    btf = MatrixBtf(path)
    return [btf.get_view(view) for view in range(len(ANGLES))]


@pytest.mark.parametrize(
    "changes",
    [{}, {"kind": "<f4", "version": 1}, {"is_transposed": True, "kind": "<f8", "rotations": 0, "version": 3}],
)
def test_values_are_in_ring_order_and_include_the_cosine(tmp_path, changes):
    path, file = container(tmp_path / "a.btf", **changes)
    btf = MatrixBtf(path)
    assert btf.size == SIZE
    theta, phi = np.radians(ANGLES).T
    expected = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=1)
    np.testing.assert_allclose(directions(btf.grid), expected, atol=1e-6)
    for view in (0, 3, 9):
        view_values = btf.get_view(view)
        for light in (0, 2, 7):
            file_values = values(file, LAST - view, LAST - light) * np.cos(theta[light])
            np.testing.assert_allclose(view_values[light], file_values, rtol=2e-6)


def test_a_cosine_in_the_values_is_not_multiplied_again(tmp_path):
    path, file = container(tmp_path / "a.btf", cosine=1)
    np.testing.assert_allclose(MatrixBtf(path).get_view(4)[9], values(file, LAST - 4, LAST - 9), rtol=2e-6)


@pytest.mark.parametrize("model", [0, 1, 9, 11, 12])
def test_colors_are_decoded_by_their_color_model(tmp_path, model):
    """Values encoded by the definition of the color model are decoded to the same values."""
    rgb = np.array([0.5, 0.25, 0.125])
    y, u, v = np.linalg.solve(YUV_TO_RGB, rgb)
    encoded = {
        0: rgb, 1: (y, u, v), 9: (np.log(y + 1e-5), u, v), 12: np.log(rgb + 1e-5),
        11: (np.log(y + 1e-5), u / (y + 1e-5), v / (y + 1e-5)),
    }[model]  # fmt: skip
    ones = np.ones((SIZE[0] * SIZE[1], 1))
    channels = [(np.full((len(ANGLES) ** 2, 1), number), ones) for number in encoded]
    path, _ = container(tmp_path / "a.btf", model=model, kind="<f8", channels=channels)
    np.testing.assert_allclose(MatrixBtf(path).get_view(0)[0], np.tile(rgb, (len(ones), 1)), rtol=1e-5)


def test_negative_products_are_clamped_to_zero(tmp_path):
    (u, v), *others = random_factors()
    path, _ = container(tmp_path / "a.btf", channels=[(-u, v), *others])
    view_values = MatrixBtf(path).get_view(0)
    assert (view_values[..., 0] == 0).all()
    assert (view_values[..., 1:] > 0).all()


def with_invalid_number(number):
    """One number of a matrix is not finite."""
    (u, v), *others = random_factors()
    v = v.copy()
    v[7, 1] = number
    return {"channels": [(u, v), *others]}


def rotated(row, theta, phi):
    other = ANGLES.copy()
    other[row] = theta, phi
    return {"views": other, "lights": other}


SHORT = random_factors(99)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"signature": b"!BDIF06R2!"}, "!BDIF06R2!.*zip"),
        ({"signature": b"!FMF12FCER"}, "not a decorrelated"),
        ({"model": 2}, "model 2"),
        ({"size": (2**31, 2)}, "rows of texels"),
        ({"size": (100_000, 100_000)}, "the limit is"),
        ({"size": (0, 5)}, "0 rows of texels"),
        ({"size": (7, 5)}, "damaged"),
        ({"channels": SHORT}, "99 × 30 values"),
        (with_invalid_number(np.nan), "not finite"),
        (with_invalid_number(np.inf), "not finite"),
        (with_invalid_number(6e4) | {"model": 12}, "not finite"),
        (rotated(9, 90.0, 0.0), "not above the horizon"),
        (rotated(9, np.nan, 0.0), "not above the horizon"),
        (rotated(9, 70.5, np.inf), "not above the horizon"),
        (rotated(9, 70.5, 200.0), "uniformly spaced on rings"),
        (rotated(9, 60.0, 288.0), "rings"),
        ({"lights": np.concatenate([ANGLES[:5], ANGLES[5:] * [1.05, 1]])}, "are different"),
        ({"views": np.tile(ANGLES, (50, 1))}, "view directions"),
    ],
)
def test_invalid_containers_are_rejected_with_the_reason(tmp_path, changes, message):
    path, _ = container(tmp_path / "bad.btf", **changes)
    with pytest.raises(MaterialError, match=message):
        images(path)


def test_every_truncated_file_is_rejected(tmp_path):
    path, file = container(tmp_path / "a.btf")
    whole = encode_container(file)
    for length in [1, 9, 12, 100, 250, 262, 300, 310, 400, 1500, *range(1600, len(whole), 997), len(whole) - 1]:
        path.write_bytes(whole[:length])
        with pytest.raises(MaterialError):
            images(path)
    path.write_bytes(whole + b"\0")
    with pytest.raises(MaterialError, match="follow its end"):
        images(path)


def test_declared_sizes_are_checked_before_allocation(tmp_path):
    """Every aligned number of the first kilobytes is replaced by the largest possible value."""
    path, file = container(tmp_path / "a.btf")
    whole = encode_container(file)
    rejected = 0
    for at in range(len(file.signature), 400, 4):
        path.write_bytes(whole[:at] + struct.pack("<I", 2**32 - 1) + whole[at + 4 :])
        try:
            MatrixBtf(path)
        except MaterialError:
            rejected += 1
    assert rejected >= 20


def test_the_command_line_imports_a_container(tmp_path, capsys):
    path, _ = container(tmp_path / "cloth.btf")
    assert main(["material", "import", str(path), "--error", "0.3", "--data", str(tmp_path / "data")]) == 0
    output = capsys.readouterr()
    assert output.out.startswith("btf:")
    assert "relative RMS" in output.err
