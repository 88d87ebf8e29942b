"""Models that others would bring, as an installable package.

Naive Bayes, a table of common sense, GloVe and co-occurrence prove what a package of models needs,
and keep their rows on the leaderboard.
"""
