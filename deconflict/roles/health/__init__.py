"""The parts of the service's health, as the operator face sees them."""
