"""The sending half of a session: frames of the newest look, and responses."""
