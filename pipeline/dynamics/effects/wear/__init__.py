"""Wear of contacts: how far their surfaces slide on each other, and with what force."""
