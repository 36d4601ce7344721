"""Imports an uploaded file in a process of its own, with limits: a hostile file can end that process, not the server.

`python -m server.importing` reads one `Order` as JSON from stdin and writes one line of JSON to stdout:
{"id": id} or {"problem": sentence}.
"""

from __future__ import annotations

import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from relume.errors import RelumeError, SceneError

if TYPE_CHECKING:  # the import process itself has no use for them, or not at once
    from relume.scene.model import Scene
    from server.settings import Settings

MAX_OUTPUT_BYTES = 64 * 1024
DAMAGED = (signal.SIGSEGV, signal.SIGBUS, signal.SIGABRT, signal.SIGFPE, signal.SIGILL)
UPLOAD_PREFIX = "upload-"
Kind = Literal["scene", "environment", "built_in", "grounded"]


@dataclass(frozen=True)
class Order:
    """What to import.

    Attributes:
        kind, file: what it is, and its path; empty for a built-in scene; of a scene to be "grounded" the folder that it
            is kept in.
        environment: path of a scene's environment map, or None.
        name: what people will call it; of a built-in scene, which one it is.
        scene: the name that a scene's file had, folders included. companions: paths of the files that came with it, by
            theirs.
        ground: whether a scene is put on one.
        seconds: of processor and wall. max_bytes: of address space.
    """

    data: str
    database: str
    kind: Kind
    file: str
    environment: str | None
    name: str
    seconds: int
    max_bytes: int
    ground: bool = False
    scene: str = ""
    companions: dict[str, str] = field(default_factory=dict)

    @classmethod
    def of(
        cls,
        settings: Settings,
        kind: Kind,
        file: Path | None,
        name: str,
        environment: Path | None = None,
        scene: str = "",
        companions: Mapping[str, Path] | None = None,
    ) -> Order:
        """An order within a server's limits."""
        return cls(
            data=str(settings.data.resolve()),
            database=settings.database_url,
            kind=kind,
            file="" if file is None else str(file),
            environment=None if environment is None else str(environment),
            name=name,
            seconds=settings.import_seconds,
            max_bytes=settings.import_bytes,
            scene=scene,
            companions={named: str(path) for named, path in (companions or {}).items()},
        )


def import_in_process(order: Order) -> str:
    """Import and register; returns the id. Blocks.

    Raises:
        SceneError: the file cannot be used, or reading it took too much.
    """
    command = [sys.executable, "-m", "server.importing"]
    # No thread pools in a short-lived process: each thread would reserve address space that counts against the limit.
    environ = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    told = json.dumps(asdict(order)).encode()
    limits = f"{order.seconds} s or {order.max_bytes / 1e9:.1f} GB"
    try:
        done = subprocess.run(  # noqa: S603
            command, input=told, capture_output=True, timeout=order.seconds, check=False, env=environ
        )
        if -done.returncode in DAMAGED:
            raise SceneError("the file made its reader fail, it is damaged; export it again")
        answer = json.loads(done.stdout[-MAX_OUTPUT_BYTES:].splitlines()[-1])
    except (subprocess.TimeoutExpired, ValueError, IndexError):
        raise SceneError(f"the import was stopped: it needs more than {limits}; simplify the file") from None
    if "problem" in answer:
        raise SceneError(answer["problem"])
    return str(answer["id"])


def remove_stray_uploads(data: Path, older_than_s: float) -> None:
    """Delete uploads that a killed server left behind; younger ones may be another server's."""
    for folder in data.glob(f"{UPLOAD_PREFIX}*"):
        with suppress(OSError):
            if time.time() - folder.stat().st_mtime > older_than_s:
                shutil.rmtree(folder)


def main() -> int:
    """The process itself."""
    order = Order(**json.loads(sys.stdin.buffer.read()))
    resource.setrlimit(resource.RLIMIT_AS, (order.max_bytes, order.max_bytes))
    resource.setrlimit(resource.RLIMIT_CPU, (order.seconds, order.seconds))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    try:
        answer = {"id": _import(order)}
    except RelumeError as error:
        answer = {"problem": str(error)}
    except MemoryError:
        answer = {"problem": f"the import needs more than {order.max_bytes / 1e9:.1f} GB; simplify the file"}
    sys.stdout.write("\n" + json.dumps(answer) + "\n")
    return 0


def _import(order: Order) -> str:
    if order.kind == "grounded":
        return _put_on_ground(order)
    return _import_environment(order) if order.kind == "environment" else _import_scene(order)


def _import_environment(order: Order) -> str:
    from relume.environments.shelf import keep
    from worker.paths import environments_path

    return keep(environments_path(Path(order.data)), Path(order.file), order.name).id


def _import_scene(order: Order) -> str:
    from relume.scene.built_in import built_in
    from relume.scene.ground import with_ground
    from worker.database import open_database
    from worker.ledger import Ledger
    from worker.scenes import register_scene

    scene = built_in(order.name) if order.kind == "built_in" else _read_scene(order)
    scene = with_ground(scene) if order.ground else scene
    return register_scene(Path(order.data), Ledger(open_database(order.database)), scene)


def _put_on_ground(order: Order) -> str:
    from relume.scene.archive import load_scene
    from relume.scene.ground import with_ground
    from worker.database import open_database
    from worker.ledger import Ledger
    from worker.scenes import register_scene

    scene = with_ground(load_scene(order.file), order.name)
    return register_scene(Path(order.data), Ledger(open_database(order.database)), scene)


def _read_scene(order: Order) -> Scene:
    from relume.light.environment import read_environment
    from relume.scene.companions import Sent
    from relume.scene.importer import import_scene, read_file

    environment = None if order.environment is None else read_environment(order.environment, "Environment")
    sent = Sent({name: Path(path) for name, path in order.companions.items()}, order.scene)
    # bytes: what lies beside the file on this disk is not its own
    return import_scene(read_file(order.file), order.name, environment, sent)


if __name__ == "__main__":
    sys.exit(main())
