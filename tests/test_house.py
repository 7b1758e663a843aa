"""The house rules that a machine can check: style, types, walls between rooms, and that the README says what the gate does."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
TOOLS = Path(sys.executable).parent


@pytest.mark.parametrize(
    "command",
    [("ruff", "check", "."), ("ruff", "format", "--check", "."), ("mypy",), ("lint-imports",)],
    ids=["ruff-check", "ruff-format", "mypy", "import-linter"],
)
def test_house_style_is_checked_by_machine(command):
    tool = TOOLS / command[0]
    if not tool.exists():
        pytest.skip(f"{command[0]} is not installed in this environment: pip install -r requirements.txt")
    done = subprocess.run([tool, *command[1:]], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout[-6000:] + done.stderr[-2000:]


def test_gate_runs_the_test_command_of_the_readme():
    script = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    lines = [line for line in script.splitlines() if line.startswith("python3 -m venv")]
    assert len(lines) == 1
    assert lines[0] in (ROOT / "README.md").read_text(encoding="utf-8")


def test_no_registry_host_or_machine_path_is_committed():
    tracked = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True)
    if tracked.returncode:
        pytest.skip("not a git checkout")
    forbidden = re.compile(r"files\.pythonhosted|//pypi\.org|registry\.npmjs|(?<![\w/.])/(?:root|work)/")
    for name in tracked.stdout.splitlines():
        path = ROOT / name
        if (
            path.suffix in {".py", ".md", ".toml", ".txt", ".yaml", ".sh", ""}
            and path.is_file()
            and path != Path(__file__)
        ):
            assert not forbidden.search(path.read_text(encoding="utf-8")), name


@pytest.mark.parametrize("package", ["geometry", "reconstruct", "planner"])
def test_every_module_says_what_it_is(package):
    for path in (ROOT / package).rglob("*.py"):
        assert path.read_text(encoding="utf-8").lstrip().startswith('"""'), (
            f"{path.relative_to(ROOT)} has no docstring"
        )
