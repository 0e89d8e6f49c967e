"""The demo's robots and the service in one process: what a person would have been told, and what came of it."""
