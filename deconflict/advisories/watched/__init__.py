"""The pairs of robots that conflict or have an open advisory, and which of them may need a revision."""
