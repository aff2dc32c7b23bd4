"""`sealag cite`: BibTeX entries that ship with the package."""

from importlib import resources

from sealag.cli._json import show_json
from sealag.version import __version__


def show_citations(*, as_json: bool) -> None:
    """Print the BibTeX entries of sealag and of the paper that it reproduces."""
    folder = resources.files("sealag.data")
    software, paper = (
        (folder / f"cite_{what}.bib").read_text("utf-8").strip() for what in ("software", "paper")
    )
    if as_json:
        show_json({"version": __version__, "software": software, "paper": paper})
    else:
        print(f"{software}\n\n{paper}")
