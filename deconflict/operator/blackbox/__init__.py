"""Black boxes: a file for each near miss, with what was received and decided. A replay gives the same advisories."""
