"""What commands print: results, and how far they are."""
