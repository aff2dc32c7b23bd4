"""Files keep the house's size, and nothing committed names a machine or a package host."""

import re
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
LONGEST_MODULE = 450
FORBIDDEN = re.compile(
    r"(?:/root/|/work/|/opt/(?:pypi|wheels)|https?://[^\s\"')]*(?:pypi|simple/))"
)


def _committed() -> list[Path]:
    names = subprocess.run(
        ["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout.splitlines()
    return [ROOT / name for name in names if (ROOT / name).is_file()]


def test_modules_stay_readable() -> None:
    long = {
        str(path.relative_to(ROOT)): count
        for path in (ROOT / "src").rglob("*.py")
        if (count := len(path.read_text().splitlines())) > LONGEST_MODULE
    }
    assert long == {}


def test_no_machine_path_or_package_host_is_committed() -> None:
    found = [
        str(path.relative_to(ROOT))
        for path in _committed()
        if path != Path(__file__)
        and path.suffix in {".py", ".toml", ".md", ".txt", ".urdf", "", ".json", ".csv"}
        and FORBIDDEN.search(path.read_text(errors="ignore"))
    ]
    assert found == []


def test_check_sees_a_machine_path() -> None:
    assert FORBIDDEN.search("see /work/main/x") is not None
    assert FORBIDDEN.search("--index-url https://pypi.org/simple") is not None
    assert FORBIDDEN.search("https://arxiv.org/abs/1234") is None
