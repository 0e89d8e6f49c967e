"""Simulated vendors on the demo's site: a moving world, how each vendor speaks of it, and real sockets."""
