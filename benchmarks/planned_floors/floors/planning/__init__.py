"""The vendors' fleets, each planning for its own robots."""
