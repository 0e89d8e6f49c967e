"""How simulated vendors encode and send messages."""
