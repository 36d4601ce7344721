#!/usr/bin/env bash
# Builds the image, starts the composed service, goes once through it and takes it down again.
# Uses docker, or podman-compose where there is no docker; COMPOSE overrides, KEEP=1 leaves the service running.
set -euo pipefail
cd "$(dirname "$0")/.."

if [ -n "${COMPOSE:-}" ]; then read -ra compose <<<"$COMPOSE"
elif docker compose version >/dev/null 2>&1 && docker info >/dev/null 2>&1; then compose=(docker compose)
elif command -v podman-compose >/dev/null; then compose=(podman-compose --podman-build-args=--network=host)
else echo "smoke: neither docker compose nor podman-compose is usable; install one of them" >&2; exit 1
fi
compose+=(-f docker/compose.yml)

"${compose[@]}" build
[ -n "${KEEP:-}" ] || trap '"${compose[@]}" down --volumes' EXIT
"${compose[@]}" up -d

for _ in $(seq 60); do
    curl --fail --silent --output /dev/null --max-time 2 http://127.0.0.1:8420/readyz && ready=1 && break
    sleep 1
done
if [ -z "${ready:-}" ]; then
    echo "smoke: the server is not ready after a minute; its last words:" >&2
    "${compose[@]}" logs server 2>&1 | tail -n 20 >&2
    exit 1
fi

"${compose[@]}" exec -T server python docker/smoke.py
for role in scheduler worker server; do
    "${compose[@]}" exec -T "$role" python docker/health.py "$role"
    echo "smoke: $role is healthy"
done
