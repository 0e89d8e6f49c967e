"""Where advisories go besides the stream and the API: webhooks and an MQTT broker.

Each outlet follows the store from a position of its own that is kept in it, so that nothing is lost while the other end
is away or the service restarts. What was sent just before the end may be sent again: `seq` tells.
"""
