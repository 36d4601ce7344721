"""The list of transfer methods. To add one: write its module beside this one and add it here."""

from __future__ import annotations

from relume.transfer.base import TransferMethod
from relume.transfer.direct import DirectMethod
from relume.transfer.gather import GatherMethod

METHODS: dict[str, TransferMethod] = {method.name: method for method in (DirectMethod(), GatherMethod())}
