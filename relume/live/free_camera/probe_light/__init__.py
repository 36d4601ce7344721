"""Incident radiance coefficients of probes: exact, previewed, or updated during an edit."""
