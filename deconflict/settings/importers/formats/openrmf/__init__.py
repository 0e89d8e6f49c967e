"""Reads buildings and navigation graphs of Open-RMF."""
