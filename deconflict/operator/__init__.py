"""The operators' side: advisory store, HTTP API, live page, outlets and black boxes."""
