#!/bin/sh
# What a container does: server, worker or scheduler; anything else is run as it stands.
set -eu

# Numba writes beside what it reads, and the image is read-only: give it a copy of the compiled kernels.
if [ "${NUMBA_CACHE_DIR:-/opt/kernels}" != /opt/kernels ]; then
    mkdir -p "$NUMBA_CACHE_DIR"
    cp -R /opt/kernels/. "$NUMBA_CACHE_DIR"
fi

case "${1:-server}" in
    server) exec relume serve --host 0.0.0.0 --port 8420 --scheduler "$RELUME_SCHEDULER" ;;
    worker) exec relume worker --scheduler "$RELUME_SCHEDULER" ;;
    scheduler) exec dask scheduler --host 0.0.0.0 --port 8786 --no-dashboard ;;
    *) exec "$@" ;;
esac
