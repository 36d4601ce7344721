"""Batch steps run one at a time in processes of their own that yield to sessions."""
