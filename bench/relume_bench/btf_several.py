"""btf.several_ratio, btf.five_vs_two: cost of an edit in a scene with unrelated BTFs.

The still life with a free camera, five of its materials covered: with five BTFs of 128 × 128 texels, with two that
alternate, and with none. An edit changes the color of a sixth material; it ends with its frame. Both figures are ratios
of medians within one run, the edits of the three alternating.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.assets.btf.btf_store import STORE, BtfRecord, store_btf
from relume.assets.btf.compress import compress
from relume.assets.btf.direction_rings import ubo_grid
from relume.assets.btf.local_pca_btf import LocalPcaBtf
from relume.assets.btf.value_cache import ValueFile
from relume.core.cache import Cache, use_for_assets
from relume.live.free_camera.free_camera_picture import FreeCameraPicture
from relume.live.opened.free_camera_transfer import BakedFreeCamera
from relume.live.opened.openers import open_bake
from relume.look import Look, validate
from relume.methods.registry import METHODS
from relume.scene.examples.catalog import built_in
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process
from relume.synthetic_btf.render import TileGeometry
from relume.synthetic_btf.synthesize import GEOMETRIES
from relume_bench.figure import Figure

_NUM = 5
_EDITED = "Bowl"


def measure(tiny: bool) -> list[Figure]:
    """Edit one material while five others are covered with none, two, and five BTFs."""
    size, num_probes, side, edits = ((40, 30), 2000, 8, 3) if tiny else ((320, 240), 15_000, 128, 40)
    recipe = Recipe("probes", ("front",), size, 300, num_probes=num_probes)
    with tempfile.TemporaryDirectory() as name, STORE.with_search_folder(Path(name) / "btfs"):
        folder, cache = Path(name), Cache(4 << 30)
        use_for_assets(cache)
        records = _records(folder, side)
        store = bake_in_process(METHODS["probes"], built_in("still_life"), recipe, folder / "s.zarr")
        transfer: Any = open_bake(store, cache)
        sessions = [_Session(transfer, records[:num]) for num in (0, 2, _NUM)]
        for number in range(edits):
            for session in sessions:
                session.edit(number)
        none, two, five = (1e3 * float(np.median(session.seconds)) for session in sessions)
    context = {
        "size": f"{size[0]}×{size[1]}", "probes": num_probes, "texels": f"{side}×{side}", "edits": edits,
        "none_ms": none, "two_ms": two, "five_ms": five,
    }  # fmt: skip
    return [
        Figure("btf.several_ratio", five / none, "of an edit without any", context),
        Figure("btf.five_vs_two", five / two, "of an edit with two", context),
    ]


class _Session:
    """An image of the still life, with some materials covered."""

    def __init__(self, transfer: BakedFreeCamera, records: Sequence[BtfRecord]) -> None:
        self._transfer, self._records = transfer, records
        self._picture, self.seconds = FreeCameraPicture(transfer, "front", is_watched=True), list[float]()
        self._picture.set_look(self._look((0.5, 0.5, 0.5)))
        self._picture.advance(None)
        while (job := self._picture.next_job()) is not None:
            job.apply(job.run(lambda share: None, lambda: False))
            self._picture.advance(None)
        self._picture.encode(self._picture.all_tiles(), "rgb9e5")

    def edit(self, number: int) -> None:
        """Change the color of the material that is not covered."""
        start_time = time.perf_counter()
        self._picture.set_look(self._look((0.3 + 0.01 * number, 0.4, 0.5)))
        self._picture.advance(None)
        self._picture.encode(self._picture.all_tiles(), "rgb9e5")
        self.seconds.append(time.perf_counter() - start_time)

    def _look(self, color: tuple[float, float, float]) -> Look:
        material_names = [name for name in self._transfer.material_names if name != _EDITED][:_NUM]
        overrides = {
            name: {"terms": self._records[index % len(self._records)].terms()}
            for index, name in enumerate(material_names)
            if self._records
        }
        edited = {"terms": [{"model": "lambert", "color": list(color)}]}
        return validate({"materials": {**overrides, _EDITED: edited}}, self._transfer.default_look)


def _records(folder: Path, side: int) -> list[BtfRecord]:
    """Five BTFs of the requested size that differ in brightness only, repeating a few texels."""
    small_side = min(side, 16)
    small_record = TileGeometry(GEOMETRIES["weave"](), ubo_grid(), (small_side, small_side), 1, 1)
    values = ValueFile(folder / "values", ubo_grid(), (small_side, small_side))
    values.fill(small_record.get_view, lambda share: None, lambda: False)
    full_record = _repeat_texture(compress(values, 0.05, lambda share: None, lambda: False), side // small_side)
    records = []
    for number in range(_NUM):
        source = folder / f"{number}.txt"
        source.write_text(str(number))
        factor = np.float32(1 - 0.1 * number)
        dimmed = replace(
            full_record, mean=(full_record.mean * factor).astype(np.float16), mean_step=full_record.mean_step * factor,
            average=full_record.average * factor,
        )  # fmt: skip
        records.append(store_btf(folder / "btfs", source, f"BTF {number}", "weave", lambda made=dimmed: made))  # type: ignore[misc]
    return records


def _repeat_texture(whole: LocalPcaBtf, times: int) -> LocalPcaBtf:
    """Repeat the texels along both sides."""
    sides, first, mip_levels = [], 0, []
    side = whole.size[0] * times
    while side:
        mip_levels.append([first, side, side])
        sides.append(side)
        first, side = first + side * side, side // 2
    cluster, weight = (
        np.concatenate([_level(array, whole.levels, k, side) for k, side in enumerate(sides)], axis=1)
        for array in (whole.cluster, whole.weight)
    )
    return replace(
        whole, levels=np.array(mip_levels, np.int32), cluster=np.ascontiguousarray(cluster),
        weight=np.ascontiguousarray(weight), height=np.zeros((1, 1), np.float32), shared=None,
    )  # fmt: skip


def _level(texels: NDArray[Any], mip_levels: NDArray[np.int32], k: int, side: int) -> NDArray[Any]:
    """One level of the repeated texels, for all directions. (V, side * side, …)"""
    first, height, width = mip_levels[min(k, len(mip_levels) - 1)]
    level_texels = texels[:, first : first + height * width].reshape(len(texels), height, width, *texels.shape[2:])
    times = max(1, side // height)
    tiled = np.tile(level_texels, (1, times, times, *[1] * (level_texels.ndim - 3)))[:, :side, :side]
    return tiled.reshape(len(texels), side * side, *texels.shape[2:])
