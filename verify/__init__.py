"""Verify a scenario: plan, simulate, judge and report; or judge a finished result.

From Python: `verify.library.check` judges a plan, `verify.judge.judge` a result folder.
"""
