"""Measured materials that were imported: one folder each, named by the hash of its file.

    <folder>/<id>/measured.binary    the file as it came
                  table.npy          the same as `relume.measured.lookup` reads it
                  material.json      name, curves and how well they do without the quotient

Look documents name one as "merl:<id>"; no other string becomes part of a path. A name means the same content wherever
it is found, so a process looks through all folders that it was told to use.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from relume.errors import MaterialError, NotFoundError, ParameterError
from relume.measured.factors import factorise
from relume.measured.lookup import F32, NUM_KNOTS, table_of
from relume.measured.merl import F64, SHAPE, read_merl
from relume.replacing import Replacing

FORMAT_VERSION = 1
MAX_MATERIALS = 500
MAX_JSON_BYTES = 1 << 20
PREFIX = "merl:"
_ID = re.compile(r"[0-9a-f]{16}")
_SOURCE, _TABLE, _RECORD = "measured.binary", "table.npy", "material.json"
_folders: list[Path] = []
Rgb = tuple[float, float, float]


@dataclass(frozen=True)
class MaterialRecord:
    """What lists show of a measured material.

    Attributes:
        created: seconds since 1970.
        lobes_error, homomorphic_error: of the curves alone, see `relume.measured.factors.Factors`.
    """

    id: str
    name: str
    created: float
    lobes_error: Rgb
    homomorphic_error: Rgb

    @property
    def data(self) -> str:
        """How look documents name it."""
        return PREFIX + self.id

    def terms(self) -> list[dict[str, Any]]:
        """The unedited material as terms of a look."""
        return [{"model": model, "data": self.data} for model in ("measured_lv", "measured_hd")]


@dataclass(frozen=True)
class Measured:
    """What the quotients and curves of a material read. lobes, homomorphic: as in `Factors`. (4, 3, 90) each"""

    table: F32
    lobes: F64
    homomorphic: F64


@contextmanager
def shelf_at(folder: Path) -> Iterator[Path]:
    """Find materials of this folder too for as long as the block runs; it need not exist yet."""
    use_shelf(folder)
    try:
        yield folder
    finally:
        _folders.remove(folder)


def use_shelf(folder: Path) -> None:
    """Find materials of this folder too from now on."""
    _folders.append(folder)


def check_name(name: str) -> str:
    """A material's name without blanks around it. Raises ParameterError unless 1 to 80 printable characters remain."""
    name = name.strip()
    if not name.isprintable() or not 1 <= len(name) <= 80:
        raise ParameterError("name", name, "1 to 80 printable characters")
    return name


def keep(folder: Path, source: Path, name: str) -> MaterialRecord:
    """Import a MERL file; the same content twice is the same material, its newest name wins.

    Raises:
        MaterialError: the file cannot be used, or the shelf is full.
    Cost: some seconds, 0.5 GB of memory.
    """
    planes = read_merl(source)
    with source.open("rb") as file:
        identity = hashlib.file_digest(file, "sha256").hexdigest()[:16]
    target = folder / identity
    if not target.exists():
        if len(records(folder)) >= MAX_MATERIALS:
            raise MaterialError(f"{MAX_MATERIALS} measured materials are kept already; delete one first")
        _fill(folder, target, source, planes, name)
    record = get_record(folder, identity)
    if record.name != name:
        document = _read(target)
        with Replacing(target / _RECORD) as out:
            out.write(json.dumps({**document, "name": name}).encode())
    return get_record(folder, identity)


def _fill(folder: Path, target: Path, source: Path, planes: F64, name: str) -> None:
    """Write the material's folder, and give it its name when it is complete."""
    table = table_of(planes)
    factors = factorise(planes, table)
    folder.mkdir(parents=True, exist_ok=True)
    document = {"format": FORMAT_VERSION, "id": target.name, "name": name, "created": time.time()}
    described = {key: np.asarray(value).tolist() for key, value in asdict(factors).items()}
    with tempfile.TemporaryDirectory(dir=folder, prefix=".") as staging:
        made = Path(staging) / target.name
        made.mkdir()
        shutil.copyfile(source, made / _SOURCE)
        np.save(made / _TABLE, table)
        (made / _RECORD).write_text(json.dumps({**document, **described}))
        try:
            os.rename(made, target)
        except OSError:
            if not target.exists():  # somebody else has imported it in the meantime
                raise


def records(folder: Path) -> list[MaterialRecord]:
    """All materials of a folder, newest first."""
    found = [get_record(folder, path.name) for path in _paths(folder)]
    return sorted(found, key=lambda record: (-record.created, record.name))


def get_record(folder: Path, identity: str) -> MaterialRecord:
    """One material. Raises NotFoundError; MaterialError where its files are damaged."""
    path = _path(folder, identity)
    document = _read(path)
    try:
        errors = [_rgb(document[key]) for key in ("lobes_error", "homomorphic_error")]
        return MaterialRecord(identity, str(document["name"]), float(document["created"]), *errors)
    except (KeyError, TypeError, ValueError) as error:
        raise _damaged(path) from error


def remove(folder: Path, identity: str) -> None:
    """Delete a material; looks that name it are refused from now on. Raises NotFoundError."""
    path = _path(folder, identity)
    get_record(folder, identity)
    shutil.rmtree(path)


def is_known(data: str) -> bool:
    """Whether a look's `data` names a material that is here."""
    return _find(data) is not None


def known_names() -> list[str]:
    """All that `data` may be."""
    return sorted({PREFIX + path.name for folder in _folders for path in _paths(folder)})


def source_of(data: str) -> Path:
    """The file that a material was imported from. Raises NotFoundError."""
    return _found(data) / _SOURCE


def material(data: str) -> Measured:
    """What a look's `data` names; its table stays on the disk and is read where it is needed.

    Raises:
        NotFoundError: it is not here. MaterialError: its files are damaged.
    """
    return _load(_found(data))


@lru_cache(maxsize=32)
def _load(path: Path) -> Measured:
    document = _read(path)
    try:
        table = np.load(path / _TABLE, mmap_mode="r", allow_pickle=False).view(np.ndarray)
        curves = [np.array(document[part], np.float64) for part in ("lobes", "homomorphic")]
    except (OSError, ValueError, KeyError, TypeError, EOFError) as error:
        raise _damaged(path) from error
    if table.shape != (*SHAPE, 3) or table.dtype != np.float32:
        raise _damaged(path)
    for curve in curves:
        if curve.shape != (4, 3, NUM_KNOTS) or not (np.isfinite(curve) & (curve > 0)).all():
            raise _damaged(path)
    return Measured(table, *curves)


def _paths(folder: Path) -> list[Path]:
    return [path for path in folder.iterdir() if _ID.fullmatch(path.name)] if folder.is_dir() else []


def _path(folder: Path, identity: str) -> Path:
    if not _ID.fullmatch(identity) or not (folder / identity).is_dir():
        raise NotFoundError(f"there is no measured material {identity[:40]!r}; import it first")
    return folder / identity


def _find(data: str) -> Path | None:
    identity = data.removeprefix(PREFIX)
    if identity == data or not _ID.fullmatch(identity):
        return None
    return next((folder / identity for folder in reversed(_folders) if (folder / identity).is_dir()), None)


def _found(data: str) -> Path:
    path = _find(data)
    if path is None:
        raise NotFoundError(f"there is no measured material {data[:40]!r}; import its file again")
    return path


def _read(path: Path) -> dict[str, Any]:
    try:
        with (path / _RECORD).open("rb") as file:
            text = file.read(MAX_JSON_BYTES + 1)
        document = json.loads(text) if len(text) <= MAX_JSON_BYTES else None
    except (OSError, ValueError, RecursionError) as error:
        raise _damaged(path) from error
    if not isinstance(document, dict) or document.get("format") != FORMAT_VERSION:
        raise _damaged(path)
    return document


def _rgb(values: Any) -> Rgb:
    red, green, blue = (float(value) for value in values)
    return red, green, blue


def _damaged(path: Path) -> MaterialError:
    return MaterialError(f"the measured material {path.name} is damaged; delete its folder and import it again")
