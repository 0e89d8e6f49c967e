"""The live map and the advisory stream over WebSockets."""
