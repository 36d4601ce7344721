"""Outcomes of opening the files of a corpus, as a user would: shown, shown with warnings, or refused with its reason.

A user opens scenes, environments, images, measured materials and MaterialX documents. All other files are parts: images
and USD layers that another file of the same set names, buffers, .mtl libraries, and files of other programs. A set is a
folder at the second level of the corpus, or a file at the first.
"""

from __future__ import annotations

import json
import re
import signal
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path, PurePath, PurePosixPath
from typing import Any

import numpy as np

from relume.assets.environments.environment import Environment
from relume.assets.environments.read_environment import read_environment
from relume.assets.measured.read_measured import read_measured
from relume.core.errors import RelumeError
from relume.core.import_warnings import ImporterWarning
from relume.images.read_image import read_image
from relume.scene_io.import_scene import import_scene
from relume.scene_io.materialx.import_document import import_materialx
from relume.scene_io.referenced_files import Folder

Outcome = dict[str, Any]
SCENES = (".glb", ".gltf", ".obj", ".ply", ".stl", ".usd", ".usda", ".usdc", ".usdz")
ENVIRONMENTS = (".hdr", ".exr")
IMAGES = (".png", ".jpg", ".jpeg", ".webp")
MEASURED = (".binary", ".bsdf", ".brdf", ".pbsdf")
MATERIALX = (".mtlx",)
_NAMING = (".glb", ".gltf", ".ply", ".usd", ".usda", ".usdc", ".mtl", *MATERIALX)
_SUFFIX = re.compile(rb"\.(?:png|jpe?g|webp|exr|hdr|usd[acz]?|mtlx)\b", re.IGNORECASE)
_DELIMITER = re.compile(rb"[\"'<>@|/\\\r\n\t\0=:]")
_LIGHT = Environment("white", np.ones((2, 4, 3), np.float32))
MAX_WARNINGS, MAX_TEXT = 6, 120
MAX_NAMING_BYTES, MAX_NAME_BYTES = 4 << 20, 100
PEER_SECONDS = 20


def list_files(root: Path) -> list[str]:
    """Files of a corpus that a user would open, as paths relative to it."""
    paths = sorted(path for path in root.rglob("*") if path.is_file())
    named = defaultdict[tuple[str, ...], set[str]](set)
    for path in paths:
        if path.suffix.lower() in _NAMING:
            names = {name.casefold() for name in _named_by(path)} - {path.name.casefold()}
            named[_set_of(path.relative_to(root))] |= names
    openable = (*SCENES, *ENVIRONMENTS, *IMAGES, *MEASURED, *MATERIALX)
    relative = [path.relative_to(root) for path in paths if path.suffix.lower() in openable]
    return [path.as_posix() for path in relative if path.name.casefold() not in named[_set_of(path)]]


def _named_by(path: Path) -> Iterator[str]:
    """Names of files in a file; in a line of an .mtl library, a keyword and options may precede them."""
    with path.open("rb") as file:
        data = file.read(MAX_NAMING_BYTES)
    for match in _SUFFIX.finditer(data):
        before = _DELIMITER.split(data[max(match.start() - MAX_NAME_BYTES, 0) : match.start()])[-1]
        name = (before + match[0]).decode("utf-8", "replace").strip()
        yield from (name, name.split()[-1]) if path.suffix.lower() == ".mtl" else (name,)


def _set_of(path: PurePath) -> tuple[str, ...]:
    return path.parts[:2]


def outcome_of(root: Path, name: str) -> Outcome:
    """Open a file of a corpus, which may name files of its set; "crashed" if an error is not for users."""
    path, folder = root / name, root.joinpath(*_set_of(PurePosixPath(name)))
    try:
        warnings = [*_READERS[path.suffix.lower()](path, Folder(path.parent, folder if folder.is_dir() else None))]
    except RelumeError as error:
        return {"outcome": "refused", "reason": _shortened(str(error))}
    except Exception as error:
        return {"outcome": "crashed", "reason": f"{type(error).__name__}: {_shortened(str(error))}"}
    if not warnings:
        return {"outcome": "shown"}
    texts = [f"{getattr(text, 'severity', 'unsupported')}: {_shortened(text)}" for text in warnings]
    more = [f"and {len(texts) - MAX_WARNINGS} more"] if len(texts) > MAX_WARNINGS else []
    return {"outcome": "shown with warnings", "warnings": texts[:MAX_WARNINGS] + more}


def _shortened(text: str) -> str:
    return text if len(text) <= MAX_TEXT else text[: MAX_TEXT - 1] + "…"


def _open_scene(path: Path, companions: Folder) -> Iterable[ImporterWarning]:
    return import_scene(path, path.stem, _LIGHT, companions).warnings


def _open_radiance(path: Path, companions: Folder) -> Iterable[str]:
    """An environment; an .exr that is none is an image, as the editor takes it for one by its name."""
    try:
        return read_environment(path, path.stem).warnings
    except RelumeError:
        if path.suffix.lower() == ".hdr":
            raise
        return _open_image(path, companions)


def _open_image(path: Path, _: Folder) -> Iterable[ImporterWarning]:
    return read_image(path, path.stem)[1]


def _open_measured(path: Path, _: Folder) -> Iterable[str]:
    return read_measured(path)[0].warnings


def _open_materialx(path: Path, companions: Folder) -> Iterable[ImporterWarning]:
    return import_materialx(path.read_bytes(), companions).warnings


_READERS: dict[str, Callable[[Path, Folder], Iterable[str]]] = {
    suffix: reader
    for suffixes, reader in (
        (SCENES, _open_scene),
        (ENVIRONMENTS, _open_radiance),
        (IMAGES, _open_image),
        (MEASURED, _open_measured),
        (MATERIALX, _open_materialx),
    )
    for suffix in suffixes
}


def peer_reads(path: Path) -> bool:
    """True if trimesh reads triangles with an area from a scene file."""
    import trimesh

    try:
        with _limited(PEER_SECONDS):
            scene = trimesh.load_scene(path)
            areas = [mesh.area_faces for mesh in scene.geometry.values() if hasattr(mesh, "faces")]
            return any((np.isfinite(area) & (area > 0)).any() for area in areas)
    except Exception:  # a peer raises all kinds
        return False


@contextmanager
def _limited(seconds: int) -> Iterator[None]:
    def stop(*_: Any) -> None:
        raise TimeoutError

    before = signal.signal(signal.SIGALRM, stop)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def read_table(path: Path) -> dict[str, Outcome]:
    """The committed outcomes by path."""
    table: dict[str, Outcome] = json.loads(path.read_text(encoding="utf-8"))
    return table


def write_table(path: Path, table: dict[str, Outcome]) -> None:
    """Write outcomes, one file a line, so that a change is a changed line."""
    lines = [f"{json.dumps(name)}: {json.dumps(table[name], ensure_ascii=False)}" for name in sorted(table)]
    path.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")


def summary(table: dict[str, Outcome]) -> str:
    """Number of files by outcome; of refused ones, those that a peer reads, and the most frequent reasons."""
    counts = Counter(each["outcome"] for each in table.values())
    refused = [each for each in table.values() if each["outcome"] == "refused"]
    num_peers = sum(each.get("peer") == "reads it" for each in refused)
    lines = [f"{len(table):,} files: " + ", ".join(f"{counts[outcome]:,} {outcome}" for outcome in sorted(counts))]
    lines.append(f"refused although trimesh reads them: {num_peers:,}")
    reasons = Counter(_kind_of(each["reason"]) for each in refused)
    return "\n".join([*lines, *(f"{num:6,}  {reason}" for reason, num in reasons.most_common())])


def _kind_of(reason: str) -> str:
    """A reason without names, numbers and addresses in a document."""
    plain = re.sub(r"“[^”]*”|(?<!\w)'[^']*'?|\([^)]*\)", "…", re.sub(r" at \S+: .*", "", reason))
    return re.sub(r"\d[\d,.]*", "N", plain)[:90]


def differences(expected: dict[str, Outcome], outcomes: dict[str, Outcome]) -> list[str]:
    """Paths whose outcome differs, with both outcomes; of the paths in `outcomes`."""
    return [
        f"{name}\n  was {_without_peer(expected.get(name))}\n  is  {_without_peer(outcome)}"
        for name, outcome in outcomes.items()
        if _without_peer(expected.get(name)) != _without_peer(outcome)
    ]


def _without_peer(outcome: Outcome | None) -> Outcome | None:
    return None if outcome is None else {key: value for key, value in outcome.items() if key != "peer"}


def suffix_of(name: str) -> str:
    """Lower-case suffix of a path in a table."""
    return PurePosixPath(name).suffix.lower()
