"""Which vendor a robot belongs to, and which vendor may report it."""
