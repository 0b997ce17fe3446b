"""Who asks, and what they may: tokens, logins, roles, and the door that every request passes."""
