"""Scores of advisories, probabilities and forecasts: each is compared with what happened."""
