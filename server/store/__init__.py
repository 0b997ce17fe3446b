"""Where sessions are kept: a database of records and blobs by their SHA-256."""
