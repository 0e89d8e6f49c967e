"""The probability that a pair of robots gets in each other's way."""
