"""Pages and figures for people: the explorer, figures, the evaluation report."""
