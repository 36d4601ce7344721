"""Several people on one look: rooms, the places in them, and the sessions that share what a room has."""
