"""Outlets: webhooks and an MQTT broker, which receive every revision of the kinds that they ask for.

Each outlet has a position in the store, which the store keeps. So nothing is lost while the receiver is down or the
service restarts. A revision may be sent twice around a restart; receivers recognise it by its `seq`.
"""
