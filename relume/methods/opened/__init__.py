"""Opened bakes of fixed cameras: stored arrays as the transfer that images are made from."""
