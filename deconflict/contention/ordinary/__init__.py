"""What is ordinary work at a place and hour: learned, counted, and not published."""
