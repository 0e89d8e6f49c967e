"""Beyond one machine: floors cut into tiles, engines that each judge some of them, and the broker between them."""
