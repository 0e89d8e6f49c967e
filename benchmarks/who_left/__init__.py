"""Who has left, on floors whose truth is known: alerts on robots that are gone, and on silent ones that are not."""
