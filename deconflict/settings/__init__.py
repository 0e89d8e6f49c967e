"""The site file: what a person sets, how it is checked, and what is derived from it."""
