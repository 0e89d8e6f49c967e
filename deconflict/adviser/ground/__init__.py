"""Where robots may be sent: places, and the ground that they need."""
