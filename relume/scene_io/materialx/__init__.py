"""MaterialX documents as materials: https://materialx.org. Read `import_document` first."""
