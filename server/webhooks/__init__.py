"""Webhooks: what happens here, told to other programs as signed POSTs that are repeated until they are taken."""
