"""What was seen of a robot from message to message: how it moves, where nodes are, and what happens at the end of its
base."""
