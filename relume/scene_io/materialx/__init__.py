"""MaterialX documents as materials: https://materialx.org. Read `importer` first."""
