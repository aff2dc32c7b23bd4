"""Files appear whole or not at all."""

import os

import pytest

from sealag.errors import FileError
from sealag.files import write_text, written_whole


def test_a_failure_leaves_what_was_there(tmp_path):
    path = tmp_path / "a.txt"
    write_text(path, "old")
    with pytest.raises(RuntimeError), written_whole(path) as file:
        file.write(b"half")
        raise RuntimeError
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["a.txt"]
    write_text(path, "new é")
    assert path.read_text(encoding="utf-8") == "new é"


def test_folders_are_made_and_blocked_ones_named(tmp_path):
    write_text(tmp_path / "b" / "c.txt", "x")
    with pytest.raises(FileError, match=r"c\.txt"):
        write_text(tmp_path / "b" / "c.txt" / "d.txt", "x")
