"""Measured isotropic BRDFs (MERL) and their factorizations into curves.

Read first: `measured_store`, `factorize`.
"""
