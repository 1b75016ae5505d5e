"""Every figure printed in Manor 2015 beside ours: what docs/reproduction.md is made of.

`python -m benchmarks.reproduction` measures all topics anew, draws their pictures and writes the page;
`--only TOPIC` does so for one and keeps the others, `--page` writes the page from what is kept.
"""
