"""Where robots stand and where they go, as contention asks for it."""
