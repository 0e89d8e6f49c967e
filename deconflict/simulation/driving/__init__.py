"""How the robots of the halls drive: their ways, their order, their protective stops."""
