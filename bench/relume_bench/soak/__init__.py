"""The soak: a server under sessions, bakes, deletes and killed processes; memory, handles and disk stay flat."""
