"""Forecasts held to account, and what they are worth: the ledger of their errors, and probabilities of contact."""
