"""How the server takes leave: it says so, lets sessions go, stops what takes long, and is gone within a bound."""
