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
    """The complete, valid look after a patch; neither argument is changed, unchanged parts are shared.

    What a patch removes is as in the scene's default again. Replacing the path "" replaces the whole look. Only what
    the patch touches is checked.

    Args:
        document: a complete look, as `complete` or an earlier call returned it.
        patch: list of at most 256 operations `add`, `remove`, `replace`, `test`.
        default: the scene's default look.
    Raises:
        EditError: the patch is malformed, does not fit the document, or a test failed.
        ParameterError: the patched look is not valid.
    """
    if not isinstance(patch, list | tuple) or len(patch) > MAX_OPERATIONS:
        raise EditError(f"an edit is a list of at most {MAX_OPERATIONS} operations; send several edits")
    patched: Any = document
    for k, operation in enumerate(patch):
        try:
            patched = _apply(patched, _check_operation(operation, k))
        except RecursionError as error:  # jsonpatch copies values recursively
            raise EditError(f"operation {k} has a value nested too deep; no look is nested like that") from error
        except _PATCH_ERRORS as error:
            location = f"{operation['op']} at {operation['path']!r}"
            raise EditError(f"operation {k} cannot be applied, {location}: {_failure_reason(error)}") from error
    return complete_changes(patched, default, document)


def rebase(document: Any, patch: Iterable[dict[str, Any]]) -> Any:
    """A look after a patch that was made for another state of it; operations that do not fit are left out.

    The editor does the same (`client_web/src/state/document/jsonPatch.ts`). Nothing is completed or checked.

    Args:
        document: a look; it is not changed, unchanged parts are shared. patch: operations that are well formed.
    """
    for operation in patch:
        with suppress(*_PATCH_ERRORS):
            document = _apply(document, operation)
    return document


def _failure_reason(error: Exception) -> str:
    """Say what went wrong without the piece of a look that the libraries quote."""
    if isinstance(error, jsonpatch.JsonPatchTestFailed):
        return "the test failed"
    return "there is nothing like that in this look"


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
    """One operation on a copy of the containers along its path: the rest of the document is shared."""
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
