"""TLS, tokens and origins."""
