"""Bakes of fixed views, opened: what their arrays are to pictures."""
