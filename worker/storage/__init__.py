"""Scenes and finished bakes in object storage, and as many of them here as there is room for."""

from worker.storage.kept import fetched, forget, is_elsewhere, open_kept, push
from worker.storage.remote import configured

__all__ = ["configured", "fetched", "forget", "is_elsewhere", "open_kept", "push"]
