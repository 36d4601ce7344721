"""The database: any SQLAlchemy URL, its tables, its failures."""

from relume_worker.database.connect import open_database

__all__ = ["open_database"]
