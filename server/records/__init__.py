"""What the server keeps in its database: saved looks, what links carry, and the rows of long work."""
