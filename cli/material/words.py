"""What commands say of a material that they have kept."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from relume.btf.shelf import BtfRecord
    from relume.measured.asset_store import MaterialRecord


def tell_terms(record: BtfRecord | MaterialRecord) -> None:
    """Print its name in looks, and its terms."""
    typer.echo(record.data)
    typer.echo(f"  {json.dumps({'terms': record.terms()})}")


def tell(record: BtfRecord) -> None:
    """Print its name in looks, its terms, and how well it is kept."""
    tell_terms(record)
    typer.echo(
        f"  {record.clusters} clusters × {record.components} components, 1:{record.ratio:.0f}, "
        f"{record.error[-1]:.1%} relative RMS"
    )
