"""Who is still there of the robots that have fallen silent."""
