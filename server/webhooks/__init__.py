"""Webhooks: other programs are notified of what happens here by signed POSTs, repeated until they are taken."""
