"""Random mutations of project files and robots, taken through everything that reads them."""
