"""Waits for a database server that is away for some seconds, where giving up would cost what is being made."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import ParamSpec, TypeVar

from sqlalchemy.exc import DBAPIError

from worker.database.faults import database_away, is_away

RETRY_S = 1.0

Result = TypeVar("Result")
Given = ParamSpec("Given")


def patiently(
    gives_up: Callable[[], bool], call: Callable[Given, Result], *args: Given.args, **kwargs: Given.kwargs
) -> Result:
    """The result of a call on the ledger, asked again as long as the database is away.

    Args:
        gives_up: whether to wait no longer; then what the call raises passes, as do all other failures at once.
        call: that may be made twice. args, kwargs: of it.
    """
    while True:
        try:
            result = call(*args, **kwargs)
        except DBAPIError as error:
            if not is_away(error) or gives_up():
                raise
            database_away.meet(error)
            time.sleep(RETRY_S)
        else:
            database_away.well()
            return result
