"""Waits for a database server that is away for some seconds, where giving up would cost what is being made."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import ParamSpec, TypeVar

from sqlalchemy.exc import DBAPIError

from relume_worker.database.failures import is_unavailable

RETRY_S = 1.0

Result = TypeVar("Result")
Given = ParamSpec("Given")


def with_retry(
    gives_up: Callable[[], bool], call: Callable[Given, Result], *args: Given.args, **kwargs: Given.kwargs
) -> Result:
    """The result of a call on the ledger, asked again as long as the database is away.

    Args:
        gives_up: whether to wait no longer; then what the call raises passes, as do all other failures at once.
        call: that may be made twice. args, kwargs: of it.
    """
    while True:
        try:
            return call(*args, **kwargs)
        except DBAPIError as error:
            if not is_unavailable(error) or gives_up():
                raise
            time.sleep(RETRY_S)
