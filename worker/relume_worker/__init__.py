"""Bakes: the ledger, the service that runs them on Dask, storage, database, backup."""
