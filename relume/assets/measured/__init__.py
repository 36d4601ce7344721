"""Measured isotropic BRDFs (MERL, RGL, Cornell) and their factorizations into curves.

Read first: `measured_store`, `read_measured`, `factorize`.
"""
