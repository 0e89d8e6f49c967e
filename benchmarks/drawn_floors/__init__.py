"""Honest robots beside whatever else can be on a floor: drawn at random, driven in simulated time, compared."""
