"""Contention: who will want the same dock, lift or aisle, who waits for whom, and who stands in the way."""
