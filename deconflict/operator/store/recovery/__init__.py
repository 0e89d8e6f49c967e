"""What outlasts a file of advisories that is damaged, lost or can't be used for a while."""
