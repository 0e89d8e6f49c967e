"""A client of amr-deconflict, and the models of what the service publishes. It needs nothing of the service itself."""
