"""Radiance files of all writers show the same map."""

import itertools

import numpy as np
import pytest

from relume.assets.environments.read_environment import read_environment
from relume.core.errors import SceneError

WIDTH, HEIGHT = 16, 8
USUAL = [b"#?RADIANCE", b"FORMAT=32-bit_rle_rgbe"]
CODES = np.random.default_rng(7).integers(128, 256, (HEIGHT, WIDTH, 4), dtype=np.uint8)
CODES[..., 3] = 120 + np.arange(WIDTH)
RADIANCE = CODES[..., :3] * 2.0 ** (CODES[..., 3:].astype(int) - 136)


def hdr(pixels, lines=USUAL, resolution=b"-Y 8 +X 16", newline=b"\n"):
    return newline.join([*lines, b"", resolution, b""]) + pixels


def read(*args, **options):
    return read_environment(hdr(*args, **options), "map")


def with_run_lengths(codes):
    """Rows as Radiance writes them since 1991: each channel as runs and literals."""
    rows = []
    for row in codes:
        channels = [bytes([len(plane)]) + bytes(plane) for plane in row.T]
        rows.append(bytes([2, 2, len(row) >> 8, len(row) & 255]) + b"".join(channels))
    return b"".join(rows)


@pytest.mark.parametrize(
    "data",
    [
        hdr(CODES.tobytes()),
        hdr(with_run_lengths(CODES)),
        hdr(CODES.tobytes(), newline=b"\r\n"),
        hdr(with_run_lengths(CODES), newline=b"\r\n"),
        hdr(CODES.tobytes(), [b"#?RGBE", *USUAL[1:]]),
        hdr(CODES.tobytes(), [b"#?RADIANCE"]),
        hdr(CODES.tobytes(), [b"FORMAT=32-bit_rle_rgbe"]),
        hdr(CODES.tobytes(), [*USUAL, b"# " + b"a comment" * 9_000, b"pfilt -x 16 -e 2"]),
        hdr(CODES.tobytes(), [*USUAL, b"VIEW= -vtv -vp 0 0 0 -vd 0 1 0", b"PIXASPECT=1", b"SOFTWARE=a = b"]),
        hdr(CODES.tobytes(), [*USUAL, b"EXPOSURE=  1.0000000000000", b"COLORCORR= 1 1 1"]),
        hdr(CODES.tobytes(), resolution=b"-Y  8   +X\t16 "),
        hdr(CODES.tobytes(), resolution=b"-y 8 +x 16"),
        hdr(CODES.tobytes(), resolution=b"-Y 00008 +X 000016"),
        b"\n".join([*USUAL, b"-Y 8 +X 16", b""]) + CODES.tobytes(),  # no empty line
    ],
)
def test_variants_of_headers_and_run_lengths_are_read(data):
    environment = read_environment(data, "map")
    np.testing.assert_array_equal(environment.radiance, RADIANCE.astype(np.float32))
    assert environment.warnings == ()


@pytest.mark.parametrize("order", list(itertools.product("+-", "+-", ("YX", "XY"))))
def test_all_eight_orders_show_the_same_map(order):
    """The first axis advances from row to row, the second within a row; +Y is upward and +X to the right."""
    first, second, axes = order
    sign = {axes[0]: first, axes[1]: second}
    columns = range(WIDTH) if sign["X"] == "+" else range(WIDTH - 1, -1, -1)
    rows = range(HEIGHT) if sign["Y"] == "-" else range(HEIGHT - 1, -1, -1)
    if axes == "YX":
        stored = [[CODES[y, x] for x in columns] for y in rows]
    else:
        stored = [[CODES[y, x] for y in rows] for x in columns]
    sides = {"X": WIDTH, "Y": HEIGHT}
    resolution = f"{first}{axes[0]} {sides[axes[0]]} {second}{axes[1]} {sides[axes[1]]}".encode()
    for pixels in (np.array(stored).tobytes(), with_run_lengths(np.array(stored))):
        environment = read(pixels, resolution=resolution)
        np.testing.assert_array_equal(environment.radiance, RADIANCE.astype(np.float32))
        assert environment.warnings == ()


def test_wide_maps_in_a_turned_order_are_scaled_down():
    stored = np.ascontiguousarray(CODES.swapaxes(0, 1)[::-1])
    environment = read_environment(hdr(stored.tobytes(), resolution=b"-X 16 -Y 8"), "map", max_width=4)
    expected = RADIANCE.reshape(2, 4, 4, 4, 3).mean(axis=(1, 3))
    np.testing.assert_allclose(environment.radiance, expected, rtol=1e-5)
    assert "scaled from 16×8 to 4×2" in environment.warnings[0]


def test_old_run_lengths_are_expanded():
    """Runs of 1 to 255, and of more than 255 as two codes, the second counting 256 each."""
    first, second, third = ([200, 150, 130, exponent] for exponent in (128, 129, 130))
    codes = np.array([first, [1, 1, 1, 2], second, [1, 1, 1, 3], third], np.uint8)
    environment = read(codes.tobytes() + bytes([1, 1, 1, 120]))
    values = environment.radiance.reshape(-1, 3)[:, 0]
    np.testing.assert_array_equal(values[:8] / values[0], [1, 1, 1, 2, 2, 2, 2, 4])
    assert (values[7:] == values[7]).all()
    long_run = np.array([first, [1, 1, 1, 1], [1, 1, 1, 1], second, [1, 1, 1, 253]], np.uint8)
    environment = read_environment(hdr(long_run.tobytes(), resolution=b"-Y 16 +X 32"), "map")
    values = environment.radiance.reshape(-1, 3)[:, 0]
    np.testing.assert_array_equal(values[:258], values[0])
    np.testing.assert_array_equal(values[258:], 2 * values[0])


def test_old_run_lengths_allocate_nothing_beyond_the_image():
    environment = read(bytes([200, 150, 130, 128]) + bytes([1, 1, 1, 255]) * 1_000)
    assert (environment.radiance == environment.radiance[0, 0]).all()
    with pytest.raises(SceneError, match="claims 1,611 MB"):
        read(bytes([200, 150, 130, 128]) + bytes([1, 1, 1, 255]) * 1_000, resolution=b"-Y 8192 +X 16384")


def test_exposures_are_divided_out():
    lines = [*USUAL, b"EXPOSURE=2", b"EXPOSURE= 4.0", b"COLORCORR= 1 2 0.5"]
    environment = read(CODES.tobytes(), lines)
    np.testing.assert_allclose(environment.radiance, RADIANCE / [8, 16, 4], rtol=1e-6)
    assert "divided by its exposure, 8 16 4," in environment.warnings[0]
    once = read(CODES.tobytes(), [*USUAL, b"EXPOSURE=0.5"])
    np.testing.assert_allclose(once.radiance, 2 * RADIANCE, rtol=1e-6)
    assert "divided by its exposure, 0.5," in once.warnings[0]


@pytest.mark.parametrize("words", [b"0", b"-1", b"nan", b"inf", b"1e300", b"", b"a", b"1 2"])
def test_invalid_exposures_give_a_warning(words):
    environment = read(CODES.tobytes(), [*USUAL, b"EXPOSURE=" + words])
    np.testing.assert_array_equal(environment.radiance, RADIANCE.astype(np.float32))
    assert "invalid exposure" in environment.warnings[0]


def test_xyze_is_converted():
    """White stays white, and a color becomes the one whose XYZ it is, adapted from equal energy to D65."""
    codes = np.full((HEIGHT, WIDTH, 4), (128, 128, 128, 129), np.uint8)
    codes[0, 0] = (111, 202, 51, 129)  # 0.867, 1.578, 0.398
    environment = read(codes.tobytes(), [b"#?RADIANCE", b"FORMAT=32-bit_rle_xyze", b"PRIMARIES= 0 0 0 0 0 0 0 0"])
    np.testing.assert_allclose(environment.radiance[1:], 1, rtol=1e-5)
    bradford = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])
    d65 = np.array([0.95046, 1.0, 1.08906])
    to_rgb = np.array([[3.2404, -1.5371, -0.4985], [-0.9693, 1.8760, 0.0416], [0.0556, -0.2040, 1.0572]])  # Lindbloom
    adapted = np.linalg.solve(bradford, bradford @ d65 / bradford.sum(axis=1) * (bradford @ (codes[0, 0, :3] / 128)))
    np.testing.assert_allclose(environment.radiance[0, 0], np.maximum(to_rgb @ adapted, 0), atol=2e-3)


@pytest.mark.parametrize("encode", [np.ndarray.tobytes, with_run_lengths])
def test_a_truncated_file_shows_its_complete_rows(encode):
    data = hdr(encode(CODES))
    environment = read_environment(data[: len(data) - len(encode(CODES[:3])) + 5], "map")
    np.testing.assert_array_equal(environment.radiance[:5], RADIANCE[:5].astype(np.float32))
    assert not environment.radiance[5:].any()
    assert [(str(w), w.severity) for w in environment.warnings] == [
        ("Environment “map” ends early or is damaged: 3 of its 8 rows were made black.", "unsupported")
    ]


def test_nothing_is_read_behind_damaged_run_lengths():
    rows = [with_run_lengths(row[None]) for row in CODES]
    rows[2] = rows[2][:4] + b"\xff\x80" + rows[2][6:]
    environment = read(b"".join(rows))
    np.testing.assert_array_equal(environment.radiance[:2], RADIANCE[:2].astype(np.float32))
    assert not environment.radiance[2:].any()


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (hdr(CODES.tobytes(), [b"#?RADIANCE", b"FORMAT=16-bit_luv"]), "pixel format “16-bit_luv”"),
        (hdr(CODES.tobytes(), resolution=b"-Y 8 -Y 16"), "no Radiance header"),
        (hdr(CODES.tobytes(), resolution=b"-Y 8"), "no Radiance header"),
        (hdr(CODES.tobytes()[:40]), "ends early"),
    ],
)
def test_files_without_a_map_are_rejected(data, message):
    with pytest.raises(SceneError, match=message):
        read_environment(data, "map")
