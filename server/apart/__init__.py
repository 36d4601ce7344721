"""Work that nobody's hand waits for, done one step at a time in processes of its own."""
