"""Verify a scenario: plan, simulate, judge and report; or judge a finished result."""

from verify.judge import Check, Judgement, judge
from verify.library import check

__all__ = ["Check", "Judgement", "check", "judge"]
