"""Uploaded BTF images are read in a separate process without further rights."""

from __future__ import annotations

import os
import signal
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from btf_containers import container
from btf_zips import zipped

from relume.assets.btf.import_btf import open_images
from relume.core.errors import MaterialError
from relume_server.batch.btf_images import SandboxedViewArrays
from relume_server.io.sandbox import missing_features

LIMITS = (4 << 30, 60)


@pytest.mark.parametrize("kind", ["zip", "container"])
def test_the_sandbox_returns_the_images_of_the_file(tmp_path: Path, kind: str) -> None:
    file = zipped(tmp_path / "a.zip") if kind == "zip" else container(tmp_path / "a.btf")[0]
    here = open_images(file)
    with closing(SandboxedViewArrays(file, *LIMITS)) as apart:
        assert apart.size == tuple(here.size)
        for ours, theirs in zip(apart.grid, here.grid, strict=True):
            np.testing.assert_array_equal(ours, theirs)
            assert ours.dtype == theirs.dtype
        for view in (0, 3, here.grid.num_directions - 1):
            np.testing.assert_array_equal(apart.get_view(view), here.get_view(view))
    assert list(tmp_path.iterdir()) == [file]


def test_the_error_of_a_file_is_reported(tmp_path: Path) -> None:
    (tmp_path / "a.zip").write_bytes(b"PK, and no more")
    with pytest.raises(MaterialError, match="truncated or damaged"):
        SandboxedViewArrays(tmp_path / "a.zip", *LIMITS)


def test_a_file_that_kills_its_reader_is_rejected(tmp_path: Path) -> None:
    with closing(SandboxedViewArrays(zipped(tmp_path / "a.zip"), *LIMITS)) as apart:
        os.kill(apart._process.pid, signal.SIGKILL)
        apart._process.wait()
        with pytest.raises(MaterialError, match=r"are damaged, or need more than 4\.3 GB"):
            apart.get_view(0)


@pytest.mark.skipif(bool(missing_features()), reason=f"this machine has no {' and no '.join(missing_features())}")
def test_the_reader_has_no_password_and_no_network(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RELUME_DATABASE", "secret")
    with closing(SandboxedViewArrays(zipped(tmp_path / "a.zip"), *LIMITS)) as apart:
        process = Path(f"/proc/{apart._process.pid}")
        assert b"RELUME_DATABASE" not in (process / "environ").read_bytes()
        status = dict(line.split(":\t", 1) for line in (process / "status").read_text().splitlines() if ":\t" in line)
        assert (status["NoNewPrivs"], status["Seccomp"]) == ("1", "2")
        limits = (process / "limits").read_text()
        assert str(LIMITS[0]) in limits
