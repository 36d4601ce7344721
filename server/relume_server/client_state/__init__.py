"""State of one client: its look, target, visible views, pending requests, socket."""
