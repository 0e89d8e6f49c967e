"""How much time robots lose to which other robots, found from reports."""
