"""Highlights of moving views: where lobes look, and what points see there."""
