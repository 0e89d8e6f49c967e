"""A replay's result as a page, as drawings and as an MCAP file."""
