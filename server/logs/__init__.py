"""What the log says: a line of text or of JSON, with the request, session, bake and user that it is about."""
