"""`relume reference`: brute force from the command line."""
