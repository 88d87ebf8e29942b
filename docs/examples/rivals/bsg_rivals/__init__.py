"""Models that others would bring: naive Bayes, GloVe and co-occurrence, as an installable package.

They prove what a package of models needs, and keep their rows on the leaderboard.
"""
