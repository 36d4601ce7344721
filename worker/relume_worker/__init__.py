"""Bakes: ledger, bake service on Dask, storage, database, backup."""
