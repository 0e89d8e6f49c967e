"""What vendors' messages lack: of a running service, and of the rules in the code."""
