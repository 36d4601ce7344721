"""Small JSON files of a store, read with a size limit."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from relume.core.errors import StoreError, StoreNotFoundError
from relume.store.schema import MAX_JSON_BYTES


def read_json(path: Path) -> dict[str, Any]:
    """Read a JSON object from a file of limited size.

    Raises:
        StoreNotFoundError: there is no such file.
        StoreError: it is too large, or is not a JSON object.
    """
    try:
        with path.open("rb") as file:
            text = file.read(MAX_JSON_BYTES + 1)
        document = json.loads(text) if len(text) <= MAX_JSON_BYTES else None
    except (FileNotFoundError, NotADirectoryError) as error:
        raise StoreNotFoundError(f"{path.parent.name}/{path.name} is not there; bake the scene again") from error
    except (ValueError, RecursionError) as error:
        raise StoreError(f"{path.parent.name}/{path.name} is not JSON; bake the scene again") from error
    if not isinstance(document, dict):
        raise StoreError(f"{path.parent.name}/{path.name} is not a JSON object of at most {MAX_JSON_BYTES} bytes")
    return document
