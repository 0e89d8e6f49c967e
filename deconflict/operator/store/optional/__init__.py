"""The store of a service, which does without its file while that can't be used."""
