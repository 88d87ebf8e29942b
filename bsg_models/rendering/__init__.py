"""Make pages and figures: the explorer, the replay, the evaluation report, and plots."""
