"""The server: REST, live sessions, rooms, jobs. Start at `app`."""
