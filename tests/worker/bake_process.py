"""A separate program that bakes the fake method and can be killed.

bake_process.py DATA_DIR LEDGER_URL METHOD_JSON WORKERS
"""

import json
import sys
from pathlib import Path

from fake_method import RECIPE, FakeMethod, tiny_scene

from relume_worker.scenes import register_scene
from relume_worker.service import BakeService


def main() -> None:
    data_dir, url, options, num_workers = sys.argv[1:]
    methods = {"fake": FakeMethod(**json.loads(options))}
    service = BakeService(Path(data_dir), url, num_workers=int(num_workers), methods=methods)
    scene_id = register_scene(service.data_dir, service.ledger, tiny_scene())
    with service, service.subscribe(service.submit(scene_id, RECIPE)) as changes:
        for status in changes:
            sys.stdout.write(f"{status.state} {status.progress:.3f} {status.problem or ''}\n")
            sys.stdout.flush()


if __name__ == "__main__":
    main()
