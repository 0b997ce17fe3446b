"""Who asks, and what they may: tokens, logins, roles, and the middleware that every request passes."""
