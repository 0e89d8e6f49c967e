"""ISO 21423 as one of the languages. Written from public descriptions of it, and not verified against its text."""
