"""Makes synthetic BTFs: renders a small geometry from all sides in light from all sides, and compresses that.

What is rendered stays in a folder until it is compressed, so that a run that was killed goes on where it was.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from relume.btf.begun import Begun
from relume.btf.compress import MOST_TEXELS, compress
from relume.btf.eigen import EigenBtf
from relume.btf.rings import ubo_rings
from relume.btf.shelf import BtfRecord, keep
from relume.btf.values import Values
from relume.errors import ParameterError
from relume.synthetic.corduroy import corduroy
from relume.synthetic.pebbles import pebbles
from relume.synthetic.render import SmallGeometry
from relume.synthetic.weave import weave

GEOMETRIES = {"weave": weave, "pebbles": pebbles, "corduroy": corduroy}
LEAST_SIZE = 8
MOST_GRID = 8
_SEED = 1
_OF_RENDERING = 0.8  # of the time, about


class Made(NamedTuple):
    """What is to be made.

    Attributes:
        geometry: one of `GEOMETRIES`. size: texels along each side.
        grid: places along each side of a texel, each seen by another part of the lens, in light of another part of
            the lamps.
        bound: relative RMS that compression may miss.
    """

    geometry: str
    size: int
    grid: int
    bound: float

    def check(self) -> None:
        """Raise ParameterError where it cannot be made."""
        if self.geometry not in GEOMETRIES:
            raise ParameterError("geometry", self.geometry, f"one of {', '.join(GEOMETRIES)}")
        if not (self.size >= LEAST_SIZE and self.size**2 <= MOST_TEXELS):
            raise ParameterError("--size", self.size, f"{LEAST_SIZE} to {int(MOST_TEXELS**0.5)} texels")
        if not 1 <= self.grid <= MOST_GRID:
            raise ParameterError("--grid", self.grid, f"1 to {MOST_GRID}")
        if not 1e-4 <= self.bound <= 0.5:
            raise ParameterError("--error", self.bound, "0.0001 to 0.5")


def make_btf(
    folder: Path,
    wanted: Made,
    name: str,
    progress: Callable[[float], object],
    cancelled: Callable[[], bool],
    making: Path | None = None,
) -> BtfRecord:
    """Render and compress; the same again is the same BTF, and one that was begun goes on.

    Args:
        folder: of the asset store. wanted: what. name: what people call it.
        progress: called with the share done. cancelled: asked now and then.
        making: folder of what was rendered so far; by default in `folder`, by what is wanted.
    Raises:
        ParameterError: it cannot be made. CancelledError: `cancelled` said so; what was rendered stays.
        MaterialError: the store is full.
    """
    wanted.check()
    making = making or folder / "making" / "-".join(str(part) for part in wanted[:3])
    making.mkdir(parents=True, exist_ok=True)
    recipe = making / "recipe.json"
    recipe.write_text(json.dumps({"synthetic": wanted._asdict(), "seed": _SEED}, sort_keys=True))

    def make() -> EigenBtf:
        size = wanted.size, wanted.size
        values = Values(making, ubo_rings(), size)
        small = SmallGeometry(GEOMETRIES[wanted.geometry](), ubo_rings(), size, wanted.grid, _SEED)
        values.fill(small.seen_from, lambda share: progress(_OF_RENDERING * share), cancelled)
        rest = 1 - _OF_RENDERING
        begun = Begun(making / "compressed", {"bound": wanted.bound})
        kept = compress(values, wanted.bound, lambda share: progress(_OF_RENDERING + rest * share), cancelled, begun)
        return replace(kept, height=small.height())

    record = keep(folder, recipe, name, wanted.geometry, make)
    shutil.rmtree(making)
    return record
