"""Compiled shortcuts for reading messages. Optional: without this folder the service reads the same, but slower."""
