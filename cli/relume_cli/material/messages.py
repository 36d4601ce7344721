"""Results of commands that import materials."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from relume_cli.terminal.printing import print_result

if TYPE_CHECKING:
    from relume.assets.btf.btf_store import BtfRecord
    from relume.assets.measured.measured_store import MaterialRecord


def print_material(record: BtfRecord | MaterialRecord, lines: list[str], *, as_json: bool) -> None:
    """Print a material's name in looks, its terms, and its compression error.

    Args:
        record: record of the material. lines: with its error. as_json: whether JSON was asked for.
    """
    terms = record.terms()
    document = {"id": record.id, "data": record.data, "name": record.name, "terms": terms}
    details = [f"  {json.dumps({'terms': terms})}", *lines]
    print_result(document, record.data, as_json=as_json, details=details)


def print_btf(record: BtfRecord, *, as_json: bool) -> None:
    """Print a BTF's name in looks, its terms, its compression error and its memory."""
    from relume.assets.btf.btf_memory import memory_bytes
    from relume.core.errors import bytes_text

    memory = bytes_text(memory_bytes(record.size, record.directions, record.clusters, record.components))
    summary = f"  {record.clusters} clusters × {record.components} components, 1:{record.ratio:.0f}, "
    print_material(record, [f"{summary}{record.error[-1]:.1%} relative RMS, {memory} while shown"], as_json=as_json)
