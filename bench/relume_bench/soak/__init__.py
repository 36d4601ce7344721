"""Soak test: a server with sessions, bakes, deletes and killed processes; memory, handles and disk stay constant."""
