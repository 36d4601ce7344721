"""Synthetic BTFs: small periodic geometry rendered for all view and light directions. Nothing here was measured."""
