"""From vendors' sockets to normalised forecasts: the receiving half of the service."""
