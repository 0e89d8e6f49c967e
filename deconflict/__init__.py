"""Predict conflicts between robots of many vendors and publish advisories. Advisory, never a safety function."""
