"""What a function of direction becomes: the in-basis, out-factors, narrow lobes."""
