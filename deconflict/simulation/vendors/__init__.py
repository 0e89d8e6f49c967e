"""How simulated vendors speak and send."""
