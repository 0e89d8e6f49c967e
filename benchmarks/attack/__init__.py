"""Attacks on the whole service beside honest robots whose meetings are known."""
