"""Who waits for whom: blockages, deadlocks and ways out."""
