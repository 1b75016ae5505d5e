"""Verify a scenario: plan, simulate, judge and report; or judge a finished result."""
