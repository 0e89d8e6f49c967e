"""Protective stops, and their records."""
