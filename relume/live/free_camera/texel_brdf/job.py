"""Compute the tables of a BTF in the background; until then its mean is displayed."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import ClassVar, Literal

from relume.live.fixed_camera.jobs import CancelCheck, ProgressCallback
from relume.live.free_camera.texel_brdf.texel_tables import TexelTables, get_texel_tables


@dataclass(frozen=True)
class TablesJob:
    """Computes the tables of a BTF; a `relume.live.fixed_camera.jobs.Job`.

    Attributes:
        data, components: arguments of `get_texel_tables`. on_done: called when they are ready.
    """

    data: str
    components: int
    on_done: Callable[[], None]

    label = "measured texture"
    state: ClassVar[Literal["precomputing"]] = "precomputing"
    is_refinement = False
    is_resumable = True

    @property
    def key(self) -> tuple[Hashable, ...]:
        """Equal for jobs of one BTF."""
        return "tables of a BTF", self.data, self.components

    def run(self, progress: ProgressCallback, is_canceled: CancelCheck) -> TexelTables:
        """Compute the tables, or wait for another thread that does: seconds for 128 × 128 texels."""
        return get_texel_tables(self.data, self.components)

    def install(self, result: TexelTables) -> None:
        """Display them."""
        self.on_done()
