"""The database: connections, tables, revisions, errors."""

from relume_worker.database.connect import open_database

__all__ = ["open_database"]
