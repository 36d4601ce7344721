"""The database: opened on any SQLAlchemy URL, its tables, and what it says when it fails."""

from worker.database.opening import open_database

__all__ = ["open_database"]
