"""What the README shows is executed: its library example, its commands, its files."""

import re
import shlex
from pathlib import Path

import pytest

from planner.cli import run

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
# The slow ones have tests of their own: tests/planner/test_report.py, test_tradeoff.py, test_wheel.py.
ELSEWHERE = {"report", "tradeoff", "view", "simulate", "retrieve", "compare", "place"}


def shell_lines():
    blocks = re.findall(r"```sh\n(.*?)```", README, re.DOTALL)
    lines = [
        line for block in blocks for line in block.splitlines() if line.startswith(".venv/bin/lidarplan")
    ]
    return [shlex.split(line, comments=True)[1:] for line in lines]


def test_library_example_prints_what_its_comment_says(capsys):
    (block,) = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    expected = re.search(r"# (\S+° \S+° \S+ m)", block).group(1)
    exec(compile(block, "README.md", "exec"), {})
    assert capsys.readouterr().out.strip() == expected


@pytest.mark.parametrize(
    "arguments", [line for line in shell_lines() if line[0] not in ELSEWHERE], ids=" ".join
)
def test_command_of_the_tour_runs(arguments, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(ROOT)
    if arguments[0] == "new":
        arguments = ["new", str(tmp_path / "campaign")]
    if arguments[0] == "export":
        arguments = [*arguments, "--out", str(tmp_path)]
    assert run(arguments) in (0, 1) if arguments[0] == "check" else run(arguments) == 0
    assert capsys.readouterr().out.strip()


def test_every_command_of_the_readme_exists():
    from planner.cli import COMMANDS

    names = {line[0].replace("-", "_") for line in shell_lines()}
    assert names <= set(COMMANDS)


def test_every_file_that_the_readme_links_is_there():
    for link in re.findall(r"\]\(([^)#]+)\)", README):
        assert link.startswith("http") or (ROOT / link).exists(), link
