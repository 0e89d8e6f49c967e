"""A whole cluster on one machine in slow motion, and what saturates first."""
