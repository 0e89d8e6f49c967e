"""Advisories on disk, and publishing them."""
