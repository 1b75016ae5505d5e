"""Braking zones that depend on the heading: what must be free ahead of a robot and beside it."""
