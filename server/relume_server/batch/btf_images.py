"""Read the images of an uploaded BTF in a separate process.

`python -m relume_server.batch.btf_images FILE FOLDER BYTES SECONDS`, started by `SandboxedViewArrays`, with the limits
of imports.

It first writes a line of JSON with the directions, or an error. Then for each line with a view's number, it writes a
line of JSON followed by the values of `relume.assets.btf.compress.ViewArrays.get_view`.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from relume.assets.btf.direction_rings import DirectionGrid
from relume.assets.btf.import_btf import open_images
from relume.core.errors import MaterialError, RelumeError
from relume_server.io.sandbox import confine, environment

F32 = NDArray[np.float32]
_MAX_FILE_BYTES = 64 << 20  # an image in a file of its own
_STOPPED = "the BTF's images are damaged, or need more than {:.1f} GB or {} s each; export the file again"


class SandboxedViewArrays:
    """Images of a file; implements `relume.assets.btf.compress.ViewArrays`.

    Args:
        file: ZIP or container. max_bytes: memory limit. seconds: seconds of processor time per view.
    Raises:
        MaterialError: the file cannot be used.
    """

    def __init__(self, file: Path, max_bytes: int, seconds: int) -> None:
        self._stopped = _STOPPED.format(max_bytes / 1e9, seconds)
        self._folder = tempfile.TemporaryDirectory(dir=file.parent, prefix="reading-")
        command = [sys.executable, "-m", "relume_server.batch.btf_images", str(file), self._folder.name]
        self._process = subprocess.Popen(  # noqa: S603
            [*command, str(max_bytes), str(seconds)], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            env=environment() | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"},
        )  # fmt: skip
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._request_pipe, self._response_pipe = self._process.stdin, self._process.stdout
        try:
            header = self._read_header()
        except BaseException:
            self.close()
            raise
        theta, first, shift = header["rings"]
        self.grid = DirectionGrid(np.array(theta, np.float32), np.array(first, np.int32), np.array(shift, np.float32))
        self.size = (int(header["size"][0]), int(header["size"][1]))

    def get_view(self, view: int) -> F32:
        """Values of all texels from one view direction, (lights, texels, 3) float32. Raises MaterialError."""
        try:
            self._request_pipe.write(f"{view}\n".encode())
            self._request_pipe.flush()
        except BrokenPipeError:
            raise MaterialError(self._stopped) from None
        shape = self._read_header()["shape"]
        expected_shape = (self.grid.num_directions, self.size[0] * self.size[1], 3)
        if tuple(shape) != expected_shape:
            raise MaterialError(self._stopped)
        values = np.empty(expected_shape, np.float32)
        if self._response_pipe.readinto(values.data.cast("B")) != values.nbytes:  # type: ignore[attr-defined]
            raise MaterialError(self._stopped)
        return values

    def _read_header(self) -> Mapping[str, Any]:
        line = self._response_pipe.readline(1 << 20)
        if not line.endswith(b"\n"):
            raise MaterialError(self._stopped)
        header: Mapping[str, Any] = json.loads(line)
        if "problem" in header:
            raise MaterialError(header["problem"])
        return header

    def close(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.wait()
        with suppress(BrokenPipeError):  # unread output
            self._request_pipe.close()
        self._response_pipe.close()
        self._folder.cleanup()


def main() -> NoReturn:
    """Main function of the process."""
    file, folder, max_bytes, seconds = Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4])
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_AS, (max_bytes, max_bytes))
    resource.setrlimit(resource.RLIMIT_FSIZE, (_MAX_FILE_BYTES, _MAX_FILE_BYTES))
    confine([file], folder)
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # output of libraries must not mix with the answers
    try:
        _extend_cpu_limit(seconds)
        images = open_images(file)
        grid_arrays = [np.asarray(array).tolist() for array in images.grid]
        _write_response(out, {"rings": grid_arrays, "size": [int(side) for side in images.size]})
        for line in sys.stdin:
            _extend_cpu_limit(seconds)
            values = np.ascontiguousarray(images.get_view(int(line)), np.float32)
            _write_response(out, {"shape": values.shape}, values)
    except RelumeError as error:
        _write_response(out, {"problem": str(error)})
    except MemoryError:
        os._exit(1)
    os._exit(0)


def _extend_cpu_limit(seconds: int) -> None:
    """Allow so much more processor time from now on."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    resource.setrlimit(resource.RLIMIT_CPU, (int(used.ru_utime + used.ru_stime) + seconds, resource.RLIM_INFINITY))


def _write_response(out: Any, header: Mapping[str, Any], values: F32 | None = None) -> None:
    out.write(json.dumps(header).encode() + b"\n")
    if values is not None:
        out.write(values.data.cast("B"))
    out.flush()


if __name__ == "__main__":
    main()
