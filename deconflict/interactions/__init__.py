"""When robots get in each other's way: who gave way to whom, found from reports alone."""
