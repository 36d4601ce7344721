"""Images written by commands: which looks, where to, how."""
