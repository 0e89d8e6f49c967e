"""From vendors' sockets to normalised forecasts: the part of the service that the receiver runs."""
