"""Stores of small assets: their records have warnings and a few fields of the kind, and are listed alike."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Generic, TypeVar, get_type_hints

from relume.assets.asset_store import AssetStore
from relume.core.import_warnings import ImporterWarning, warning_of


@dataclass(frozen=True)
class SmallAssetRecord:
    """An asset in lists; kinds add fields.

    Attributes:
        reference: its name in looks. created: seconds since 1970.
        warnings: warnings about the import, one sentence each.
    """

    id: str
    reference: str
    name: str
    created: float
    warnings: tuple[ImporterWarning, ...]


Record = TypeVar("Record", bound=SmallAssetRecord)


@dataclass(frozen=True)
class SmallAssetStore(AssetStore, Generic[Record]):
    """The store of one kind of small assets.

    Attributes:
        record_type: of its records; the fields that it adds are read from JSON and have its types.
    """

    record_type: type[Record] = field(kw_only=True)

    def import_asset(
        self,
        folder: Path,
        source: Path,
        name: str,
        warnings: tuple[ImporterWarning, ...],
        fill: Callable[[Path], dict[str, Any]],
    ) -> Record:
        """Store an asset; an existing one with this content gets the new name. See `AssetStore.store`.

        Args:
            warnings: warnings about its import. fill: writes its files, and returns the fields that the kind adds.
        """
        documents = [warning.document() for warning in warnings]
        identity = self.store(folder, source, name, lambda staged: {**fill(staged), "warnings": documents})
        return self.get_record(folder, identity)

    def get_record(self, folder: Path, identity: str) -> Record:
        """Return the record of one asset. Raises NotFoundError; self.problem if its files are damaged."""
        path = self.path(folder, identity)
        document = self.load_record(path)
        warnings, types = document.get("warnings"), get_type_hints(self.record_type)
        added = {name: document.get(name) for name in types.keys() - get_type_hints(SmallAssetRecord)}
        if not isinstance(warnings, list) or not all(isinstance(added[name], types[name]) for name in added):
            raise self.damaged_error(path)
        return self.record_type(
            id=identity,
            reference=self.prefix + identity,
            name=document["name"],
            created=document["created"],
            warnings=tuple(map(warning_of, warnings)),
            **added,
        )

    def list_records(self, folder: Path) -> list[Record]:
        """Return the records of all assets in a folder, newest first."""
        return self.records(folder, self.get_record)
