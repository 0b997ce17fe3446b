"""What the routes about tokens, logins and the log take and give; these are the names in the API's schema."""

from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

RoleName = Literal["read", "capture", "release", "admin"]


class Me(BaseModel):
    """Who asks, and what they may; `role` is null for who is not logged in."""

    name: str
    role: RoleName | None
    login: Literal["token", "cookie", "not-needed", "missing"]


class LoginRequest(BaseModel):
    """What the login page sends."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={
            "examples": [{"token": "scancell_0123456789ab_the-43-characters-that-an-admin-gave-to-you"}]
        },
    )

    token: str = Field(max_length=200)


class TokenRequest(BaseModel):
    """A token to be made: for whom, what it is good for, and for how long (left out: until it is revoked)."""

    model_config = ConfigDict(
        extra="forbid", json_schema_extra={"examples": [{"name": "robot cell 4", "role": "capture", "days": 365}]}
    )

    name: str = Field(max_length=200)
    role: RoleName
    days: float | None = Field(default=None, gt=0, le=36525)


class TokenRecord(BaseModel):
    """All of a token but itself."""

    id: str
    name: str
    role: RoleName
    created: str
    expires: str | None
    revoked: str | None


class MadeToken(TokenRecord):
    """A new token; `token` is given this once and is null when the request is repeated."""

    token: str | None


class TokenRecords(BaseModel):
    """All tokens, the newest first."""

    items: list[TokenRecord]


class AuditEntry(BaseModel):
    """Who did what, or was refused it."""

    number: int
    at: str
    who: str
    role: str
    token: str | None
    address: str
    method: str
    path: str
    outcome: Literal["done", "refused"]
    change: dict[str, Any] | None = None


class AuditPage(BaseModel):
    """A page of the log, the newest first; `next` is the following page's cursor."""

    items: list[AuditEntry]
    next: str | None
