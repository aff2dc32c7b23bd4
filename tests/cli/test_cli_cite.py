"""`sealag cite`: entries that BibTeX reads, the same facts as in CITATION.cff."""

import json
import re
from pathlib import Path

import pytest

import sealag
from sealag.cli import main

CITATION = Path(__file__).resolve().parents[2] / "CITATION.cff"


def cite(capsys, *options):
    with pytest.raises(SystemExit) as stop:
        main(["cite", *options])
    assert stop.value.code == 0
    return capsys.readouterr().out


def fields(entry):
    """The fields of one BibTeX entry, braces removed."""
    return {key: value.strip("{}") for key, value in re.findall(r"(\w+) = \{(.*)\},?\n", entry)}


def test_entries_are_balanced_and_named(capsys):
    out = cite(capsys)
    assert re.findall(r"^@(\w+)\{(\w+),$", out, flags=re.MULTILINE) == [
        ("software", "sealag"),
        ("inproceedings", "zhao2016passivity"),
    ]
    assert out.count("{") == out.count("}")


def test_json_has_the_same_entries(capsys):
    answer = json.loads(cite(capsys, "--json"))
    assert answer["version"] == sealag.__version__
    assert cite(capsys) == f"{answer['software']}\n\n{answer['paper']}\n"


def test_entries_agree_with_the_citation_file(capsys):
    answer = json.loads(cite(capsys, "--json"))
    software, paper = fields(answer["software"]), fields(answer["paper"])
    citation = CITATION.read_text()
    assert f"\nversion: {sealag.__version__}\n" in citation
    assert software["version"] == sealag.__version__
    assert f"\nlicense: {software['license']}\n" in citation
    for title in (software["title"], paper["title"]):
        assert title in citation
    for family in re.findall(r"family-names: (\w+)", citation):
        assert family in paper["author"]
    assert f"year: {paper['year']}\n" in citation


def test_the_comparison_sees_another_version():
    assert fields("@software{sealag,\n  version = {0.0.1},\n}")["version"] != sealag.__version__
