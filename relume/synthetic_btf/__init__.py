"""Synthetic BTFs: small periodic geometry rendered for all view and light directions, without measurements."""
