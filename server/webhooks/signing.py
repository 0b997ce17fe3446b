"""Signatures of the Standard Webhooks specification, for which many languages have a library that checks them."""

import hmac
from base64 import b64decode, b64encode
from hashlib import sha256

_PREFIX = "whsec_"


def secret_of(key: bytes, webhook_id: str) -> str:
    """Return a webhook's secret, which is stored nowhere: it follows from the data folder's key and the id."""
    return _PREFIX + b64encode(hmac.digest(key, f"webhook {webhook_id}".encode(), sha256)).decode()


def signed_headers(secret: str, message_id: str, timestamp_s: int, body: bytes) -> dict[str, str]:
    """Return the headers by which a receiver knows that a body came from here, and when.

    Parameters
    ----------
    secret : str
        As the answer that made the webhook gave it.
    message_id : str
        The same for each attempt to deliver it: who sees it twice leaves the second out.
    timestamp_s : int
        Seconds since 1970: receivers refuse what is old, so that nobody can send it again later.
    body : bytes
    """
    signed = f"{message_id}.{timestamp_s}.".encode() + body
    digest = hmac.digest(b64decode(secret.removeprefix(_PREFIX)), signed, sha256)
    return {
        "webhook-id": message_id,
        "webhook-timestamp": str(timestamp_s),
        "webhook-signature": f"v1,{b64encode(digest).decode()}",
    }
