"""Imported materials of the library: materials of files as partial looks. Read `material_store` first."""
