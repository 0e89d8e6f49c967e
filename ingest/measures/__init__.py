"""Counters of the receiver, and detection of changes in measured values."""
