"""The MQTT brokers whose robots are heard."""
