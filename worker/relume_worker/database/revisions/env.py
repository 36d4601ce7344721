"""Run revisions on the connection from `relume_worker.database.upgrading`, inside its transaction."""

from alembic import context

context.configure(
    connection=context.config.attributes["connection"], target_metadata=context.config.attributes.get("metadata")
)
context.run_migrations()
