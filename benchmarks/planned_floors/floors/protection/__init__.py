"""Protective stops, and notes of them."""
