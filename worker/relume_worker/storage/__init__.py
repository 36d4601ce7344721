"""Scenes and bakes in object storage, and a bounded local cache of them."""

from relume_worker.storage.local_cache import delete_remote, fetch_if_missing, is_in_storage, open_cached, push
from relume_worker.storage.remote import get_storage

__all__ = ["delete_remote", "fetch_if_missing", "get_storage", "is_in_storage", "open_cached", "push"]
