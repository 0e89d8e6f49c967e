"""Actions: what people can have robots do about a conflict, each proven by another sweep."""
