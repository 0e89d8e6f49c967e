"""Counters of the receiving half, and detection of changes in what is measured."""
