"""Open bakes, executors, disk space and the cache as the server uses them."""
