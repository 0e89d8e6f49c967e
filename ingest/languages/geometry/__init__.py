"""Curves and outlines as messages draw them."""
