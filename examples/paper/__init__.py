"""The paper's experiments on simulated scans whose truth is known: ``make gallery`` writes ``docs/paper.md`` and its pictures."""
