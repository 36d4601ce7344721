"""Wait for an unavailable database server if giving up would lose work."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import ParamSpec, TypeVar

from sqlalchemy.exc import DBAPIError

from relume_worker.database.failures import is_locked, is_unavailable

RETRY_S = 1.0

Result = TypeVar("Result")
Given = ParamSpec("Given")


def with_retry(
    gives_up: Callable[[], bool], call: Callable[Given, Result], *args: Given.args, **kwargs: Given.kwargs
) -> Result:
    """Call the ledger, and retry as long as the database is unavailable, or locked by others.

    Args:
        gives_up: true to stop waiting; then the error propagates, as all other errors do at once.
        call: may run twice. args, kwargs: arguments and keyword arguments of the call.
    """
    while True:
        try:
            return call(*args, **kwargs)
        except DBAPIError as error:
            if not (is_unavailable(error) or is_locked(error)) or gives_up():
                raise
            time.sleep(RETRY_S)
