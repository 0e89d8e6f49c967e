"""Floors of cells with an adviser in the loop."""
