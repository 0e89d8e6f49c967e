"""A cluster of machines: floors cut into tiles, engines that judge some tiles each, and NATS between them."""
