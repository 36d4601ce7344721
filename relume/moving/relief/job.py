"""The tables of a BTF that a look shows for the first time, made beside the frames: until then its mean is shown."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import ClassVar, Literal

from relume.moving.relief.tables import ReliefTables, relief_tables
from relume.picture.jobs import Cancelled, Progress


@dataclass(frozen=True)
class TablesJob:
    """Makes them; a `relume.picture.jobs.Job`.

    Attributes:
        data, components: of `relief_tables`. take: called when they are there.
    """

    data: str
    components: int
    take: Callable[[], None]

    what = "measured texture"
    state: ClassVar[Literal["freezing"]] = "freezing"
    refines = False
    goes_on = True

    @property
    def key(self) -> tuple[Hashable, ...]:
        """Equal for jobs of one BTF."""
        return "tables of a BTF", self.data, self.components

    def make(self, progress: Progress, cancelled: Cancelled) -> ReliefTables:
        """Find the tables, or wait for whoever does: seconds for 128 x 128 texels."""
        return relief_tables(self.data, self.components)

    def install(self, made: ReliefTables) -> None:
        """Have them shown."""
        self.take()
