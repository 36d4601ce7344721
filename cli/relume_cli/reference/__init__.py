"""`relume reference`: brute-force reference images."""
