"""The service and the path believer on floors of many kinds and seeds."""
