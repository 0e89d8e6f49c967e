"""What is kept of a fleet for people to read, and what they are told of its robots."""
