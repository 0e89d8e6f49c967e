"""Simulated floors of robots with plans, on which the truth is known: `python -m benchmarks.planned_floors`."""
