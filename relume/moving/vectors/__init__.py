"""Light vectors of a moving picture: exact, found quickly, or behind a hand by some frames."""
