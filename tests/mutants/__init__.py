"""Semantic mutants: one-line changes that falsify an answer, and the tests that must notice."""
