"""relume as the server uses it: bakes that are opened and closed, pictures, and the threads they work in."""
