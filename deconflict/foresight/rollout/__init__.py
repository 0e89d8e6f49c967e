"""Drives robots on along their forecasts, with protective stops, many times: who gives way to whom."""
