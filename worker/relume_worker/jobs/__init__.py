"""Jobs that take minutes and survive restarts: one table, one lease, one service that runs them.

A kind says how its jobs run. Bakes are `relume_worker.bake_kind`; renders, comparisons and BTFs, which have steps, are
in `relume_server.jobs`. Read first: `job_service`, `kind`, `job_kind`.
"""
