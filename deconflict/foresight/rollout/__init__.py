"""Drives robots on along their forecasts, with protective stops, in several samples, to see which pairs give way."""
