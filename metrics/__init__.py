"""What the service measures of itself and how well it foresaw: metrics for Prometheus, and scores."""
