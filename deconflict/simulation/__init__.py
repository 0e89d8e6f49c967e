"""Simulated vendors on the demo's site: the world, the messages of each vendor, and real sockets."""
