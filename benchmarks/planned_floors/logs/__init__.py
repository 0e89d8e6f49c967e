"""Logs of messages, written and read without code of the service."""
