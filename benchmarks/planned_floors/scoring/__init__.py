"""Scores of alerts and probabilities against the truth."""
