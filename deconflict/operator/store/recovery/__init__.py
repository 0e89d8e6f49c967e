"""What outlasts a file of advisories that is damaged or lost."""
