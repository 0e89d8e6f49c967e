"""The transform between two frames, found from what robots drive in each."""
