"""nginx that publishes a test server below /relume/."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from replicas_proxy import running_nginx

PREFIX = "/relume"
_CONFIGURATION = """
pid {folder}/nginx.pid;
error_log stderr crit;
events {{ }}
http {{
    access_log off;
    client_body_temp_path {folder}/body;
    proxy_temp_path {folder}/proxy;
    fastcgi_temp_path {folder}/fastcgi;
    uwsgi_temp_path {folder}/uwsgi;
    scgi_temp_path {folder}/scgi;
    map $http_upgrade $connection_of {{ default upgrade; "" ""; }}
    server {{
        listen 127.0.0.1:{port};
        proxy_http_version 1.1;
        proxy_set_header Host $http_host;
        proxy_set_header Upgrade $http_upgrade;
        proxy_set_header Connection $connection_of;
        proxy_read_timeout {timeout_s}s;
        location /relume/ {{ proxy_pass http://127.0.0.1:{server_port}{path}; }}
    }}
}}
"""


@contextmanager
def proxy_below_prefix(folder: Path, server_port: int, *, is_stripped: bool, timeout_s: int = 60) -> Iterator[str]:
    """URL of the server below /relume/; skips the test if nginx is not installed.

    Args:
        folder: for nginx's files. is_stripped: whether nginx removes the prefix.
        timeout_s: time after which nginx cuts idle connections.
    """
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    path = "/" if is_stripped else ""
    text = _CONFIGURATION.format(folder=folder, port=port, timeout_s=timeout_s, server_port=server_port, path=path)
    with running_nginx(folder, port, text):
        yield f"http://127.0.0.1:{port}{PREFIX}/"
