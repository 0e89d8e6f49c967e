"""Which robot gave way to which, found from reports."""
