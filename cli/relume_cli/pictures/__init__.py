"""Images written by commands: looks, files, formats."""
