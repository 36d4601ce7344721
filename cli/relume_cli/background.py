"""Continue one bake without a terminal: RELUME_DATABASE=URL python -m relume_cli.background DATA SCHEDULER BAKE."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from relume_worker.service import BakeService


def main() -> None:
    """Bake until the bake has ended, here or on another machine."""
    os.umask(0o077)
    data, scheduler, identity = sys.argv[1:]
    bakes = BakeService(Path(data), os.environ["RELUME_DATABASE"], scheduler or None)
    with bakes as service, service.subscribe(identity) as changes:
        for _ in changes:
            pass


if __name__ == "__main__":
    main()
