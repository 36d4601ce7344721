"""Goes on with one bake without a terminal: python -m cli.background DATA DATABASE_URL SCHEDULER BAKE."""

from __future__ import annotations

import sys
from pathlib import Path

from worker.service import BakeService


def main() -> None:
    """Bake until that bake has ended, whoever ends it."""
    data, database_url, scheduler, identity = sys.argv[1:]
    with BakeService(Path(data), database_url, scheduler or None) as service, service.subscribe(identity) as changes:
        for _ in changes:
            pass


if __name__ == "__main__":
    main()
