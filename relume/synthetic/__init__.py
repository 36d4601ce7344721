"""Synthetic BTFs: small periodic geometry, lit and looked at from all sides. Nothing here was measured."""
