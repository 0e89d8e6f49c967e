"""Alerts and probabilities held against the truth."""
