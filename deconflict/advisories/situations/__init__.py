"""Situations: open advisories that share robots or a place, as one thing for a person to look at."""
