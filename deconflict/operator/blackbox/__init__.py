"""Black boxes: around each near miss a file of what was heard and decided, which replays to the same advisories."""
