"""Scenes and finished bakes in object storage, and as many of them here as there is room for."""

from worker.storage.kept import delete_remote, fetch_if_missing, is_in_storage, open_cached, push
from worker.storage.remote import get_storage

__all__ = ["delete_remote", "fetch_if_missing", "get_storage", "is_in_storage", "open_cached", "push"]
