"""The operators' side: the store, the API, the live page, outlets and black boxes."""
