"""What the two halves of a session have in common: the look, what is shown, what was asked for, the socket."""
