"""The advisory database, and publishing to subscribers."""
