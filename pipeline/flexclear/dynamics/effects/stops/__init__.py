"""Stops: contacts at the ends of joint coordinates."""
