"""Languages in which vendors report. Each folder turns the messages of one language into the shared model."""
