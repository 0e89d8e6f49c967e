"""What the service decides over eight logs, compared with what it decided when they were kept."""
