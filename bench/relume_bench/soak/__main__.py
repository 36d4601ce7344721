"""`make soak MINUTES=120`: exit 0 if nothing failed, and memory, handles, threads and disk stayed constant."""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from dataclasses import asdict
from pathlib import Path

from relume_bench.soak.server import Sample, SoakServer
from relume_bench.soak.users import Users
from relume_bench.soak.verdict import trends

MINUTES, EVERY_S, SEED = 120.0, 5.0, 1


def main() -> int:
    """Run the soak test, and print its result."""
    parser = argparse.ArgumentParser(prog="make soak", description=__doc__)
    parser.add_argument("--minutes", type=float, default=MINUTES)
    parser.add_argument("--samples", type=Path, help="file for the measurements, JSON lines")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="relume-soak-") as folder:
        server = SoakServer(Path(folder))
        try:
            users, samples = _soak(server, 60 * asked.minutes)
        finally:
            has_stopped = server.stop()
        traces = server.log.count("Traceback")
    if asked.samples is not None:
        asked.samples.write_text("".join(json.dumps(asdict(sample)) + "\n" for sample in samples))
    trend_lines = trends(samples)
    lines = [
        *(f"{count:7} {event}" for event, count in sorted(users.counts.items())),
        *(each.line() for each in trend_lines),
    ]
    lines += users.failures + ([] if traces == 0 else [f"{traces} internal errors in the server's log"])
    lines += [] if has_stopped else ["the server did not stop cleanly"]
    sys.stdout.write("\n".join(lines) + "\n")
    return 0 if has_stopped and not users.failures and traces == 0 and all(each.is_flat for each in trend_lines) else 1


def _soak(server: SoakServer, seconds: float) -> tuple[Users, list[Sample]]:
    users, start_s = Users(server, SEED), time.monotonic()
    samples: list[Sample] = []
    users.start()
    try:
        while (at_s := time.monotonic() - start_s) < seconds and server.is_alive:
            samples.append(server.sample(at_s))
            time.sleep(EVERY_S)
    finally:
        users.stop()
    if not server.is_alive:
        users.failures.append("the server has ended")
    return users, samples


if __name__ == "__main__":
    sys.exit(main())
