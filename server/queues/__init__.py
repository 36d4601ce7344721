"""Work that takes minutes and outlives the server: batch renders, and comparisons with brute force."""
