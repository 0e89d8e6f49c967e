"""Which robot waits for which: blockages, deadlocks and ways out."""
