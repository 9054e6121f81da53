"""Print docs/matching.md's tables: technique x matcher, at constant and at disturbed speeds.

Run: .venv/bin/python benchmarks/matching_table.py [DATA_FOLDER] > table.md

Every cell is the share of query frames whose own answer (`Matches.by_frame`) is right, over the same
query frames for every matcher; frames off the map are right when answered "no match". Differences to
the mean are paired: 95 % block bootstrap (blocks of K frames) of the per-frame difference, seed 0.
A disturbed drive is the real query drive resampled by a seeded speed profile, so all its scores are
rows of one similarity matrix.
"""
