"""The images of a BTF that was sent, read by a process of its own: `python -m server.apart.btf_images FILE FOLDER BYTES
SECONDS`, started by `ImagesApart`, within the limits that imports have.

It tells a line of JSON first: what directions there are, or what is wrong. Then for each view that is asked for, a line
with its number, a line of JSON goes out and the values of `relume.btf.compress.Images.seen_from` after it.
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

from relume.btf.importing import images_of
from relume.btf.rings import Rings
from relume.errors import MaterialError, RelumeError
from server.files.confining import confine, environment

F32 = NDArray[np.float32]
_MOST_FILE_BYTES = 64 << 20  # a picture that is read from a file of its own
_STOPPED = "the BTF's images made their reader fail, or need more than {:.1f} GB or {} s each; make the file again"


class ImagesApart:
    """Images of a file; implements `relume.btf.compress.Images`.

    Args:
        file: zip or container. max_bytes: of memory that reading may take. seconds: of processor, for one view.
    Raises:
        MaterialError: the file cannot be used.
    """

    def __init__(self, file: Path, max_bytes: int, seconds: int) -> None:
        self._stopped = _STOPPED.format(max_bytes / 1e9, seconds)
        self._folder = tempfile.TemporaryDirectory(dir=file.parent, prefix="reading-")
        command = [sys.executable, "-m", "server.apart.btf_images", str(file), self._folder.name]
        self._process = subprocess.Popen(  # noqa: S603
            [*command, str(max_bytes), str(seconds)], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            env=environment() | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"},
        )  # fmt: skip
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._asking, self._telling = self._process.stdin, self._process.stdout
        try:
            told = self._told()
        except BaseException:
            self.close()
            raise
        theta, first, shift = told["rings"]
        self.rings = Rings(np.array(theta, np.float32), np.array(first, np.int32), np.array(shift, np.float32))
        self.size = (int(told["size"][0]), int(told["size"][1]))

    def seen_from(self, view: int) -> F32:
        """Every texel's values from one direction. (lights, texels, 3) float32. Raises MaterialError."""
        try:
            self._asking.write(f"{view}\n".encode())
            self._asking.flush()
        except BrokenPipeError:
            raise MaterialError(self._stopped) from None
        shape = self._told()["shape"]
        wanted = (self.rings.num_directions, self.size[0] * self.size[1], 3)
        if tuple(shape) != wanted:
            raise MaterialError(self._stopped)
        values = np.empty(wanted, np.float32)
        if self._telling.readinto(values.data.cast("B")) != values.nbytes:  # type: ignore[attr-defined]
            raise MaterialError(self._stopped)
        return values

    def _told(self) -> Mapping[str, Any]:
        line = self._telling.readline(1 << 20)
        if not line.endswith(b"\n"):
            raise MaterialError(self._stopped)
        told: Mapping[str, Any] = json.loads(line)
        if "problem" in told:
            raise MaterialError(told["problem"])
        return told

    def close(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.wait()
        with suppress(BrokenPipeError):  # what nobody has read
            self._asking.close()
        self._telling.close()
        self._folder.cleanup()


def main() -> NoReturn:
    """The process itself."""
    file, folder, max_bytes, seconds = Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4])
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_AS, (max_bytes, max_bytes))
    resource.setrlimit(resource.RLIMIT_FSIZE, (_MOST_FILE_BYTES, _MOST_FILE_BYTES))
    confine([file], folder)
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # whatever a library prints is no answer
    try:
        _more_seconds(seconds)
        images = images_of(file)
        rings = [np.asarray(part).tolist() for part in images.rings]
        _tell(out, {"rings": rings, "size": [int(side) for side in images.size]})
        for line in sys.stdin:
            _more_seconds(seconds)
            values = np.ascontiguousarray(images.seen_from(int(line)), np.float32)
            _tell(out, {"shape": values.shape}, values)
    except RelumeError as error:
        _tell(out, {"problem": str(error)})
    except MemoryError:
        os._exit(1)
    os._exit(0)


def _more_seconds(seconds: int) -> None:
    """So much more processor time from now on."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    resource.setrlimit(resource.RLIMIT_CPU, (int(used.ru_utime + used.ru_stime) + seconds, resource.RLIM_INFINITY))


def _tell(out: Any, what: Mapping[str, Any], values: F32 | None = None) -> None:
    out.write(json.dumps(what).encode() + b"\n")
    if values is not None:
        out.write(values.data.cast("B"))
    out.flush()


if __name__ == "__main__":
    main()
