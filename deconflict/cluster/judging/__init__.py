"""One engine's share of a cluster, and what one engine judges for all."""
