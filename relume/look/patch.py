"""Edits: JSON Patch (RFC 6902) on a complete look."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import suppress
from typing import Any

import jsonpatch
import jsonpointer

from relume.core.errors import EditError
from relume.look.document import complete_changes

MAX_OPERATIONS = 256
MAX_PATH = 1024
_OPERATIONS = ("add", "remove", "replace", "test")
_PATCH_ERRORS = (jsonpatch.JsonPatchException, jsonpointer.JsonPointerException, TypeError, LookupError)


def apply_patch(document: Mapping[str, Any], patch: Any, default: Mapping[str, Any]) -> dict[str, Any]:
    """Return the complete, valid look after a patch. The arguments stay unmodified; unchanged objects are shared.

    Values that a patch removes revert to the scene's default. Replacing the path "" replaces the whole look. Only
    objects that the patch changes are validated.

    Args:
        document: a complete look, as returned by `complete` or an earlier call.
        patch: list of at most 256 operations `add`, `remove`, `replace`, `test`.
        default: the scene's default look.
    Raises:
        EditError: the patch is malformed, does not fit the document, or a test failed.
        ParameterError: the patched look is invalid.
    """
    if not isinstance(patch, list | tuple) or len(patch) > MAX_OPERATIONS:
        raise EditError(f"an edit is a list of at most {MAX_OPERATIONS} operations; send several edits")
    patched: Any = document
    for k, operation in enumerate(patch):
        try:
            patched = _apply(patched, _check_operation(operation, k))
        except RecursionError as error:  # jsonpatch copies values recursively
            raise EditError(f"the value of operation {k} is nested too deeply for a look") from error
        except _PATCH_ERRORS as error:
            location = f"{operation['op']} at {operation['path']!r}"
            raise EditError(f"operation {k} cannot be applied, {location}: {_failure_reason(error)}") from error
    return complete_changes(patched, default, document)


def rebase(document: Any, patch: Iterable[dict[str, Any]]) -> Any:
    """Apply a patch that was made for another state of a look; operations that do not fit are skipped.

    The editor does the same (`client_web/src/state/document/jsonPatch.ts`). The result is not completed or validated.

    Args:
        document: a look, not modified; unchanged objects are shared. patch: well-formed operations.
    """
    for operation in patch:
        with suppress(*_PATCH_ERRORS):
            document = _apply(document, operation)
    return document


def _failure_reason(error: Exception) -> str:
    """Describe the failure without quoting the look, as the libraries' messages do."""
    if isinstance(error, jsonpatch.JsonPatchTestFailed):
        return "the test failed"
    return "the path does not exist in this look"


def _check_operation(operation: Any, k: int) -> dict[str, Any]:
    if not isinstance(operation, dict) or operation.get("op") not in _OPERATIONS:
        raise EditError(f"operation {k} is not one of {', '.join(_OPERATIONS)}")
    path = operation.get("path")
    if not isinstance(path, str) or len(path) > MAX_PATH:
        raise EditError(f"operation {k} needs a path, a JSON pointer of at most {MAX_PATH} characters")
    if operation["op"] != "remove" and "value" not in operation:
        raise EditError(f"operation {k} ({operation['op']}) needs a value")
    return operation


def _apply(document: Any, operation: dict[str, Any]) -> Any:
    """Apply one operation to copies of the containers along its path; the rest of the document is shared."""
    path = jsonpointer.JsonPointer(operation["path"]).parts
    if not path and operation["op"] == "remove":
        raise EditError('the whole look cannot be removed; replace the path "" by {} for the default look')
    return jsonpatch.apply_patch(_copy_along_path(document, path), [operation], in_place=True)


def _copy_along_path(document: Any, path: list[str]) -> Any:
    if not path:
        return document
    if isinstance(document, dict):
        copy: Any = dict(document)
        if path[0] in copy:
            copy[path[0]] = _copy_along_path(copy[path[0]], path[1:])
        return copy
    if isinstance(document, list | tuple):
        copy = list(document)
        if path[0].isdecimal() and int(path[0]) < len(copy):
            copy[int(path[0])] = _copy_along_path(copy[int(path[0])], path[1:])
        return copy
    return document
