"""Floors that hear an adviser: what its advice is worth."""
