"""Authentication, roles, quotas, rate limits, and the audit log; no route decides these."""
