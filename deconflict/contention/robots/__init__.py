"""Where robots stand and where they go, as contention needs it."""
