"""Advisories, probabilities and forecasts held against the truth."""
