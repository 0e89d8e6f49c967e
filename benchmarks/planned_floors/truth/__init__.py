"""What truly happened on a floor."""
