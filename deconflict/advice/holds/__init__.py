"""Holds for a group of conflicts: which robots should wait, and how long, at the least cost."""
