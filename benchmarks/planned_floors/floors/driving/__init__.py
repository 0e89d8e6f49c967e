"""Cells, the visits to them, and how robots drive from one to the next."""
