"""Synthetic BTFs of the benchmarks: all their values, kept in bench/.kept from one run to the next."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from relume.btf.compress import compress
from relume.btf.eigen import F32, EigenBtf
from relume.btf.rings import ubo_rings
from relume.btf.shelf import BtfRecord, keep
from relume.btf.values import Values
from relume.code_version import code_hash, sources_of
from relume.synthetic.make import GEOMETRIES
from relume.synthetic.render import SmallGeometry

KEPT = Path(__file__).with_name(".kept")


class Made:
    """A synthetic BTF before compression.

    Args:
        name: of its geometry. folder: where its values are kept. tiny: whether it is a trial.
    """

    def __init__(self, name: str, folder: Path, tiny: bool) -> None:
        self.name = name
        size, self.grid = (8, 1) if tiny else (128, 3)  # as `relume material make-btf` does
        small = SmallGeometry(GEOMETRIES[name](), ubo_rings(), (size, size), self.grid, 1)
        self.values = Values(folder / name, ubo_rings(), (size, size))
        self.values.fill(small.seen_from, lambda share: None, lambda: False)
        self.height: F32 = small.height()

    def compressed(self, bound: float) -> EigenBtf:
        """Kept to an error bound, as `relume material make-btf` does."""
        kept = compress(self.values, bound, lambda share: None, lambda: False)
        return replace(kept, height=self.height)

    def kept(self, folder: Path, bound: float) -> BtfRecord:
        """The same in an asset store."""
        folder.mkdir(parents=True, exist_ok=True)
        source = folder / f"{self.name}.json"
        source.write_text(f"{self.name} {bound}")
        return keep(folder / "btfs", source, self.name, self.name, lambda: self.compressed(bound))


@contextmanager
def kept_folder(tiny: bool) -> Iterator[Path]:
    """Where values are: named by the code that makes them, those of other code are deleted; trials keep nothing."""
    if tiny:
        with TemporaryDirectory() as trial:
            yield Path(trial)
        return
    makers = ("render", "weave", "pebbles", "corduroy")
    folder = KEPT / code_hash(sources_of([f"synthetic.{name}" for name in makers]))
    for other in KEPT.iterdir() if KEPT.is_dir() else ():
        if other != folder:
            shutil.rmtree(other)
    yield folder
