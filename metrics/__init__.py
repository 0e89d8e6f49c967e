"""Metrics of the running service for Prometheus, and scores of its predictions over recorded logs."""
