"""Whole-body solvers of others, each in an environment of its own."""
