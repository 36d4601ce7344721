""".cube files: tables as OpenColorIO reads them, and messages about files that are unusable."""

from __future__ import annotations

import numpy as np
import PyOpenColorIO
import pytest

from relume.core.errors import SceneError
from relume.image_io.display_transform import DisplayTransform, to_display
from relume.luts.read_cube import MAX_BYTES, read_cube


def warm(rgb):
    """A curved transform that mixes channels. (..., 3)"""
    red, green, blue = np.moveaxis(rgb, -1, 0)
    return np.stack([red**0.8, 0.9 * green + 0.1 * red * blue, 0.7 * blue**1.3], axis=-1)


def cube_text(size, transform=warm, header="", domain=(0.0, 1.0)):
    """A 3D LUT: red varies fastest."""
    levels = np.linspace(*domain, size)
    blue, green, red = np.meshgrid(levels, levels, levels, indexing="ij")
    rows = transform(np.stack([red, green, blue], axis=-1)).reshape(-1, 3)
    return f"{header}LUT_3D_SIZE {size}\n" + "".join("{:.7f} {:.7f} {:.7f}\n".format(*row) for row in rows)


def curve_text(size, header=""):
    levels = np.linspace(0, 1, size)
    rows = np.stack([levels**0.5, levels, levels**2], axis=-1)
    return f"{header}LUT_1D_SIZE {size}\n" + "".join("{:.7f} {:.7f} {:.7f}\n".format(*row) for row in rows)


def written(tmp_path, content):
    path = tmp_path / "grade.cube"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def read(tmp_path, content):
    return read_cube(written(tmp_path, content), "grade.cube")


def applied(table, values):
    """Display values by a table, without tone map: its sRGB encoding is undone before."""
    linear = np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)
    return to_display(linear[None].astype(np.float32), DisplayTransform(0.0, "none", lut=table))[0]


def applied_by_ocio(path, values):
    transform = PyOpenColorIO.FileTransform(str(path), interpolation=PyOpenColorIO.INTERP_TETRAHEDRAL)
    processor = PyOpenColorIO.Config.CreateRaw().getProcessor(transform).getDefaultCPUProcessor()
    expected = np.array(values, np.float32)
    processor.applyRGB(expected)
    return np.clip(expected, 0, 1)


@pytest.mark.parametrize("size", [2, 16, 32, 33, 65])
def test_3d_luts_equal_opencolorio(tmp_path, size):
    values = np.random.default_rng(size).random((500, 3))
    table, warnings = read(tmp_path, cube_text(size))
    assert table.shape == (size, size, size, 3)
    assert warnings == ()
    np.testing.assert_allclose(applied(table, values), applied_by_ocio(tmp_path / "grade.cube", values), atol=4e-5)


@pytest.mark.parametrize("header", ["DOMAIN_MIN 0 0 0\nDOMAIN_MAX 2 2 2\n", "LUT_3D_INPUT_RANGE 0 2\n"])
def test_other_domains_are_resampled(tmp_path, header):
    values = np.random.default_rng(3).random((500, 3))
    table, warnings = read(tmp_path, cube_text(17, lambda rgb: warm(rgb / 2), header, (0.0, 2.0)))
    assert table.shape == (65, 65, 65, 3)
    assert warnings == ()
    np.testing.assert_allclose(applied(table, values), warm(values / 2), atol=0.02)
    if header.startswith("DOMAIN"):
        by_ocio = applied_by_ocio(tmp_path / "grade.cube", values)
        np.testing.assert_allclose(applied(table, values), by_ocio, atol=4e-5)


def test_1d_luts_are_curves_of_each_channel(tmp_path):
    values = np.random.default_rng(4).random((500, 3))
    table, warnings = read(tmp_path, curve_text(65))
    assert warnings == ()
    np.testing.assert_allclose(applied(table, values), applied_by_ocio(tmp_path / "grade.cube", values), atol=4e-5)


def test_lost_detail_of_1d_luts_is_reported_with_its_size(tmp_path):
    _, warnings = read(tmp_path, curve_text(4096))  # of a root near black
    assert [warning.severity for warning in warnings] == ["approximated"]
    # a root between nodes at 0 and 1/64 is off by at most a quarter of its value at the node, 1/8
    assert "65 nodes" in warnings[0]
    assert "by up to 8.0 of 255" in warnings[0]


def test_sloppy_files_are_read(tmp_path):
    """A byte order mark, Windows line ends, comments, blank lines, tabs, Latin-1 titles and no last line end."""
    text = cube_text(2, header='# made by hand\n\nTITLE "Wärme"\n').replace("LUT_3D_SIZE 2", "LUT_3D_SIZE 2  # nodes")
    sloppy = b"\xef\xbb\xbf" + text.replace(" 1.0", "\t1.0").rstrip().replace("\n", "\r\n").encode("latin-1")
    np.testing.assert_array_equal(read(tmp_path, sloppy)[0], read(tmp_path, cube_text(2))[0])


def test_clipped_values_and_unknown_keywords_are_reported(tmp_path):
    table, warnings = read(tmp_path, cube_text(2, lambda rgb: 1.5 * rgb - 0.2, "LUT_IN_VIDEO_RANGE\n"))
    assert [warning.severity for warning in warnings] == ["ignored", "unsupported"]
    assert "LUT_IN_VIDEO_RANGE" in warnings[0]
    assert (table.min(), table.max()) == (0, 65535)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (cube_text(3).replace("LUT_3D_SIZE 3", "LUT_3D_SIZE 256"), "LUT_3D_SIZE 256; export it with a size from 2"),
        (cube_text(3).replace("LUT_3D_SIZE 3", "LUT_3D_SIZE 9999999999"), "size from 2 to 65"),
        (cube_text(3).replace("LUT_3D_SIZE 3", "LUT_3D_SIZE 2.5"), "size from 2 to 65"),
        (cube_text(3).replace("LUT_3D_SIZE 3", "LUT_3D_SIZE"), "size from 2 to 65"),
        (cube_text(3).replace("LUT_3D_SIZE 3", "LUT_1D_SIZE 1"), "size from 2 to 65536"),
        (cube_text(3)[:-40], "neither a keyword nor three numbers|26 rows"),
        (cube_text(3) + "0 0 0\n", "has 28 rows, but LUT_3D_SIZE 3 needs 27"),
        (cube_text(2).replace("1.0000000", "nan"), "values that are no numbers"),
        (cube_text(2).replace("1.0000000", "inf"), "values that are no numbers"),
        (cube_text(2).replace("LUT_3D_SIZE 2\n", ""), "no LUT_3D_SIZE or LUT_1D_SIZE"),
        ("LUT_1D_SIZE 2\n0 0 0\n1 1 1\n" + cube_text(2), "a 1D and a 3D LUT"),
        (cube_text(2, header="DOMAIN_MIN 1 0 0\nDOMAIN_MAX 1 1 1\n"), "domain .* is empty"),
        (cube_text(2, header="DOMAIN_MAX 1 nan 1\n"), "DOMAIN_MAX .* is not 3 numbers"),
        (cube_text(2, header="DOMAIN_MIN 0\n"), "DOMAIN_MIN .* is not 3 numbers"),
        (cube_text(2) + "1 2\n", "line 10 .* neither a keyword nor three numbers"),
        (bytes(range(256)) * 50, "neither a keyword nor three numbers"),
        (b"", "no LUT_3D_SIZE"),
    ],
)
def test_unusable_files_are_rejected_with_a_reason(tmp_path, content, message):
    with pytest.raises(SceneError, match=message):
        read(tmp_path, content)


def test_large_files_are_rejected_before_they_are_read(tmp_path):
    path = written(tmp_path, "LUT_3D_SIZE 2\n")
    with path.open("r+b") as file:
        file.truncate(MAX_BYTES + 1)
    with pytest.raises(SceneError, match="larger than 32 MB"):
        read_cube(path, "grade.cube")
