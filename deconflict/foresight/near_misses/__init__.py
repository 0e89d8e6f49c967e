"""Near misses by the reports of two robots: when each was, how near, and which advisory warned of it."""
