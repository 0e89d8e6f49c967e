"""Simulated floors of robots with plans."""
