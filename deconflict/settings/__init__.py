"""The site file: its settings, its checks, and what is created from it."""
