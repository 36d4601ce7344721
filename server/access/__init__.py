"""Who calls, what that one may do, how much of it, and what has been done: all of it here, and in no route."""
