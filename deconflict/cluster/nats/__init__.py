"""NATS: connection, subscriptions and records. Nothing outside this folder imports the library."""
