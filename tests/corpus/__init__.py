"""Robots of any folder, each from its file to a short run, by the command line alone."""
