"""Schema migrations of the store, run by Alembic when the store is opened."""
