"""What commands say of a BTF that they have kept."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from relume.btf.shelf import BtfRecord


def tell(record: BtfRecord) -> None:
    """Print its name in looks, its terms, and how well it is kept."""
    typer.echo(record.data)
    typer.echo(f"  {json.dumps({'terms': record.terms()})}")
    typer.echo(
        f"  {record.clusters} clusters × {record.components} components, 1:{record.ratio:.0f}, "
        f"{record.error[-1]:.1%} relative RMS"
    )
