"""Runs a recorded log through the live engine, and scores the output."""
