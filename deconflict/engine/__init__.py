"""The engine: batches in, advisory revisions out. It drives the sweep, foresight, advisories, advice and contention."""
