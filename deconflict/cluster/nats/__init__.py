"""The cluster's use of NATS: parcels, the durable stream of revisions, shared state and requests."""
