"""What passes between the engine and the other roles: ticks, decisions, and the stored state."""
