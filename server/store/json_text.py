"""Data that is JSON text already."""


class JsonText(str):
    """JSON text, of finite numbers alone: it is stored and sent as it is."""

    __slots__ = ()
