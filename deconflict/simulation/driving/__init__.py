"""How the robots of the halls drive: paths, right of way, protective stops."""
