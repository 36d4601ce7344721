"""Pictures that commands make: of which looks, where to, and how they are painted."""
