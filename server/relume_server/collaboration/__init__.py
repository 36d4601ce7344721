"""Rooms: several people on one look, their membership, and the lease that names the room's server."""
