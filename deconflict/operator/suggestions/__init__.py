"""What to change on the floor, from the sums of lost time."""
