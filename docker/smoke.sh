#!/usr/bin/env bash
# Builds the image, starts the composed service, goes once through it and takes it down again.
# Uses docker, or podman-compose where docker does not run. KEEP=1 leaves the service running.
set -euo pipefail
cd "$(dirname "$0")/.."

if docker compose version >/dev/null 2>&1 && docker info >/dev/null 2>&1; then
    engine=docker compose=(docker compose)
elif command -v podman-compose >/dev/null; then
    engine=podman compose=(podman-compose --podman-build-args=--network=host)
else
    echo "smoke: neither docker compose nor podman-compose is usable; install one of them" >&2
    exit 1
fi
compose+=(-f docker/compose.yml)
run=("$engine" run --rm --read-only --tmpfs /tmp:mode=1777)

"${compose[@]}" build server # the other roles are the same image
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

"${run[@]}" --network host relume:latest python docker/smoke.py http://127.0.0.1:8420
for role in scheduler worker server; do
    container=$("$engine" ps -q --filter label=com.docker.compose.project=relume \
        --filter "label=com.docker.compose.service=$role")
    # beside the container and not in it: some hosts forbid exec
    "${run[@]}" --network "container:$container" -e RELUME_SCHEDULER=tcp://scheduler:8786 \
        relume:latest python docker/health.py "$role"
    echo "smoke: $role is healthy"
done
