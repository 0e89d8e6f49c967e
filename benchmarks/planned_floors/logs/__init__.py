"""Logs of messages, written and read as a stranger reads them."""
