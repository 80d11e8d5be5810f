"""Panels, overlays and tables that several figures of the paper share."""
