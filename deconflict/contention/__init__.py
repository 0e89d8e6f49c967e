"""Contention: queues at shared places, deadlocks, and robots in the way of others."""
