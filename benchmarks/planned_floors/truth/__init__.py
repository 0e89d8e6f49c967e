"""The truth of a floor."""
