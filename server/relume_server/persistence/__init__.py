"""Tables and stores of the database: looks, shares, comments, jobs, room leases."""
