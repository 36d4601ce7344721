"""Jobs that take minutes and survive restarts: one table, one lease, one service that runs them.

A kind of job says what its steps are; renders, comparisons and BTFs are in `relume_server.jobs`. Read first:
`job_kind`, `job_service`.
"""
