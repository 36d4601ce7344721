"""Rooms: several participants share one look; membership, and the lease of the room's server."""
