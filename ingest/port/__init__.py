"""The robots' port: sockets, queueing and rate limits."""
