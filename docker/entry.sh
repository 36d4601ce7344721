#!/bin/sh
# What a container does: server, worker or scheduler; anything else is run as it stands.
set -eu

# The image is read-only and Numba writes where it reads: give this container a copy of the compiled kernels.
[ -e "$XDG_CACHE_HOME" ] || cp -R /opt/cache "$XDG_CACHE_HOME"

case "${1:-server}" in
    server) exec relume serve --host 0.0.0.0 --port 8420 --scheduler "$RELUME_SCHEDULER" ;;
    worker) exec relume worker --scheduler "$RELUME_SCHEDULER" ;;
    scheduler) exec dask scheduler --host 0.0.0.0 --port 8786 --no-dashboard ;;
    *) exec "$@" ;;
esac
