"""Advice: which robots should wait, and how long, at the least cost. Pure: data and the time in, advice out."""
